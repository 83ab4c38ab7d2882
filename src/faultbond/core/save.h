/* A state as bytes that every processor reads alike, and back. What they hold, one after the other, each number in eight
   bytes, the lowest first: mark, format, hash of the model; all FIELDS; rows of the past; lanes of the bank, one by one, so
   that they can be read with another number of lanes side by side; CRC-32 of all before. A checksum finds damage, not
   malice. */
#ifndef FB_SAVE_H
#define FB_SAVE_H

#include "fields.h"
#include "watch.h"

FB_SELDOM

#define SAVED_MARK 0x657461747362666LL /* "fbstate" */
#define SAVED_FORMAT 12
#define MODEL_WORDS 4 /* of the hash */

/* Why a call was refused. */
enum { FB_GOOD = 0, FB_NOT_SAVED = -1, FB_OTHER_FORMAT = -2, FB_OTHER_MODEL = -3, FB_DAMAGED = -4 };

/* Where in the bytes reading or writing stands, and what is done there. */
typedef struct {
    uint8_t *to;         /* writing; NULL: reading */
    const uint8_t *from;
    int is_trial;        /* reading: only look whether the numbers can be */
    int is_sound;
} Tape;

/* CRC-32 (IEEE 802.3), four bits at a time. */
static uint32_t checksum(const uint8_t *bytes, int64_t n)
{
    uint32_t table[16], crc = 0xffffffffu;
    for (uint32_t k = 0; k < 16; k++) {
        table[k] = k;
        for (int bit = 0; bit < 4; bit++) table[k] = table[k] >> 1 ^ (table[k] & 1u ? 0xedb88320u : 0u);
    }
    for (int64_t k = 0; k < n; k++) {
        crc = crc >> 4 ^ table[(crc ^ bytes[k]) & 15u];
        crc = crc >> 4 ^ table[(crc ^ (uint32_t)(bytes[k] >> 4)) & 15u];
    }
    return ~crc;
}

static void put_word(uint8_t *to, uint64_t word)
{
    for (int k = 0; k < 8; k++) to[k] = (uint8_t)(word >> (8 * k) & 255u);
}

static uint64_t get_word(const uint8_t *from)
{
    uint64_t word = 0;
    for (int k = 0; k < 8; k++) word |= (uint64_t)from[k] << (8 * k);
    return word;
}

/* Whether a number of a field is one that a run may have. */
static int is_allowed(const Field *field, uint64_t word)
{
    double value;
    if (field->is_whole) {
        int64_t whole;
        memcpy(&whole, &word, sizeof whole);
        if (whole < -(int64_t)LARGEST_COUNT || whole > (int64_t)LARGEST_COUNT) return 0;
        value = (double)whole;
    } else {
        memcpy(&value, &word, sizeof value);
    }
    if (isnan(value)) return field->may_be_nan;
    if (isinf(value)) return field->may_be_infinite && value >= field->least && value <= field->most;
    return value >= field->least && value <= field->most;
}

/* Pass n numbers of a state, `step` numbers apart, to or from the tape. */
static void pass_numbers(Tape *tape, const Field *field, void *numbers, int64_t n, int64_t step)
{
    uint8_t *at = (uint8_t *)numbers;
    for (int64_t k = 0; k < n; k++, at += 8 * step) {
        uint64_t word;
        if (tape->to) {
            memcpy(&word, at, 8);
            put_word(tape->to, word);
            tape->to += 8;
            continue;
        }
        word = get_word(tape->from);
        tape->from += 8;
        if (tape->is_trial) tape->is_sound &= is_allowed(field, word);
        else memcpy(at, &word, 8);
    }
}

/* Pass all numbers of a state. */
static void pass_state(Tape *tape, State *state)
{
    static const Field anything = {"", 0, 0, -INFINITY, INFINITY, 0, 1, 1}; /* of filters that may have run away */
    static const Field finite = {"", 0, 0, -INFINITY, INFINITY, 0, 0, 0};
    for (int64_t k = 0; k < N_FIELDS; k++)
        pass_numbers(tape, &FIELDS[k], (uint8_t *)state + FIELDS[k].offset, FIELDS[k].count, 1);
    for (int64_t k = 0; k < N_ROWS; k++) {
        Row *row = &state->past.rows[k];
        pass_numbers(tape, &anything, row->sample, N_SAMPLE, 1);
        pass_numbers(tape, &anything, row->lane, PLAIN_NUMBERS, 1);
        pass_numbers(tape, &finite, &row->time, 1, 1);
        pass_numbers(tape, &anything, &row->wildness, 1, 1);
    }
    for (int64_t lane = 0; lane < N_STEPS; lane++)
        pass_numbers(tape, &anything, number_of_step(&state->bank, lane, 0), PLAIN_NUMBERS, GROUP);
    for (int64_t lane = 0; lane < N_WIDE; lane++)
        pass_numbers(tape, &anything, number_of_slot(&state->bank, lane, 0), WIDE_NUMBERS, GROUP);
}

/* Bytes of a saved state. */
static int64_t saved_size(void)
{
    int64_t words = 2 + MODEL_WORDS + (int64_t)(sizeof(Past) / 8) + N_STEPS * (int64_t)PLAIN_NUMBERS;
    words += N_WIDE * (int64_t)WIDE_NUMBERS + 1;
    for (int64_t k = 0; k < N_FIELDS; k++) words += FIELDS[k].count;
    return 8 * words;
}

static void save_state(const State *state, uint8_t *bytes)
{
    Tape tape = {bytes + 8 * (2 + MODEL_WORDS), NULL, 0, 1};
    put_word(bytes, SAVED_MARK);
    put_word(bytes + 8, SAVED_FORMAT);
    for (int k = 0; k < MODEL_WORDS; k++) put_word(bytes + 8 * (2 + k), MODEL_HASH[k]);
    pass_state(&tape, (State *)state); /* is only read */
    put_word(tape.to, checksum(bytes, saved_size() - 8));
}

/* Whole number k of a field that stands at this place of a state, as the bytes have it. */
static int64_t saved_whole(const uint8_t *bytes, int64_t offset, int64_t k)
{
    const uint8_t *at = bytes + 8 * (2 + MODEL_WORDS);
    int64_t whole;
    for (const Field *field = FIELDS; field->offset != offset; field++) at += 8 * field->count;
    const uint64_t word = get_word(at + 8 * k);
    memcpy(&whole, &word, sizeof whole);
    return whole;
}

#define EACH(name, k) saved_whole(bytes, (int64_t)offsetof(State, name), k)
#define SAVED(name) EACH(name, 0)

/* Whether the numbers of samples are in an order that a run can have. */
static int is_in_order(const uint8_t *bytes)
{
    const int64_t index = SAVED(clock.index), begun = SAVED(clock.begun), alarm = SAVED(clock.alarm);
    const int64_t gathering = SAVED(clock.running) || begun < 0 ? 0 : index - begun;
    const int64_t last = index - 1, decided = alarm < 0 ? last : alarm; /* accepting a diagnosis ends its alarm */
    return begun <= index && alarm <= last && SAVED(clock.accepted) <= decided && SAVED(clock.over) <= decided && gathering <= START_PATIENCE;
}

/* Whether a lane of a group is one of those that begin at a stage; of sets in reserve, one of a set that was chosen. */
static int is_of_stage(const uint8_t *bytes, int64_t stage, int64_t lane)
{
    if (stage == PAIRS) return 1; /* is not asked for there */
    if (stage == SLOTS) return lane < SWITCHED;
    if (stage == RAMPS) return lane >= RAMPED && lane < SWITCHED && (lane - RAMPED) % 2 == 0;
    if (stage == COUPLES) return lane < N_COUPLE_LANES && EACH(job.bases, lane) >= 0 && EACH(bank.coupled, row_of_lane(lane)) >= 0;
    if (stage != RESERVES) return lane < N_PLANNED;
    return lane >= N_PLANNED && lane < N_STEPS && EACH(bank.grown, (lane - N_PLANNED) / PER_SET) >= 0;
}

/* Whether a search has an onset that is or may be tried, and none beyond `last`, places in order. */
static int is_search(const uint8_t *bytes, int64_t last)
{
    const int64_t n = SAVED(job.search.n);
    int any = 0, ordered = SAVED(job.onset) < n;
    for (int64_t k = 0; k < n; k++) {
        any |= EACH(job.search.standing, k) != SPARE;
        ordered &= EACH(job.search.place, k) <= last && (k == 0 || EACH(job.search.place, k - 1) < EACH(job.search.place, k));
    }
    return any && ordered;
}

/* Whether the group at which work stands is one that it may be at. */
static int is_group(const uint8_t *bytes)
{
    const int64_t stage = SAVED(job.stage), pass = SAVED(job.pass), oldest = SAVED(job.oldest), next = SAVED(job.next);
    int good = stage < N_STAGES;
    for (int64_t row = 0; row < N_GROWN && stage == RESERVES && SAVED(job.group) > 0; row++)
        good &= EACH(bank.grown, row) >= 0;
    if (!good || pass == OPENING) return good;
    for (int64_t l = 0; l < GROUP; l++) good &= is_of_stage(bytes, stage, EACH(job.lane, l));
    if (pass == CATCHING_UP) return good && next > oldest && next <= SAVED(clock.index);
    return good && stage != PAIRS && is_search(bytes, SAVED(job.end) - oldest) &&
           (SAVED(job.onset) < 0 || (next >= oldest && next <= SAVED(job.end)));
}

/* Whether work on the bank is as a run can leave it: what it says of lanes, of onsets and of samples that are kept, goes into
   tables as a place. */
static int is_work(const uint8_t *bytes)
{
    const int64_t kind = SAVED(job.kind), oldest = SAVED(job.oldest), end = SAVED(job.end), alarm = SAVED(clock.alarm);
    const int64_t index = SAVED(clock.index), settled = SAVED(job.settled);
    int good = SAVED(job.n_singles) <= SAVED(job.n_wanted) && SAVED(job.n_wanted) <= N_PLANNED;
    for (int64_t l = 0; l < GROUP; l++) {
        const int64_t samples = EACH(job.walk.samples, l), steps = EACH(job.walk.steps, l);
        good &= samples > 0 ? steps > 0 && steps <= samples : steps == 0;
    }
    if (!good || settled > SAVED(job.ended) || SAVED(job.ended) > index) return 0;
    if (kind == IDLE) return alarm < 0 || settled >= 0;
    return alarm >= 0 && alarm <= end && oldest <= end && end - oldest < DEPTH && end < index && index < oldest + N_ROWS &&
           (kind == BEGINNING) == (settled < 0) && (kind == BEGINNING) == (SAVED(job.renewals) == 0) && is_group(bytes);
}

/* Take a state from n bytes; it is as it was where they are refused. */
static int restore_state(State *state, const uint8_t *bytes, int64_t n)
{
    if (n < 16 || get_word(bytes) != SAVED_MARK) return FB_NOT_SAVED;
    if (get_word(bytes + 8) != SAVED_FORMAT) return FB_OTHER_FORMAT;
    if (n < 8 * (2 + MODEL_WORDS)) return FB_DAMAGED;
    for (int k = 0; k < MODEL_WORDS; k++)
        if (get_word(bytes + 8 * (2 + k)) != MODEL_HASH[k]) return FB_OTHER_MODEL;
    if (n != saved_size() || get_word(bytes + n - 8) != checksum(bytes, n - 8)) return FB_DAMAGED;
    Tape tape = {NULL, bytes + 8 * (2 + MODEL_WORDS), 1, 1};
    pass_state(&tape, state);
    if (!tape.is_sound || !is_in_order(bytes) || !is_work(bytes)) return FB_DAMAGED;
    tape.from = bytes + 8 * (2 + MODEL_WORDS);
    tape.is_trial = 0;
    pass_state(&tape, state);
    fill_last_block(&state->bank);
    fill_up_slots(&state->bank);
    fill_up_couples(&state->bank);
    return FB_GOOD;
}

FB_OFTEN

#endif
