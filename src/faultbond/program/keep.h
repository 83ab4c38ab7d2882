/* The file that keeps a run: what the core remembers, where the grid of the recording stands, and what was found. It is read
   before the run, and written at an alarm, every minute and at the end: as a whole, beside its place, and then renamed into it.

   All in words of eight bytes, the lowest first: mark, format, hash of the model (eight words of letters), how many words of the
   clock, of what was found, and bytes of the core's state; these; CRC-32 of all before. */
#ifndef WATCH_KEEP_H
#define WATCH_KEEP_H

#include "course.h"

#define KEPT_MARK 0x6863746177626600ULL
#define KEPT_FORMAT 2
#define KEPT_MEANWHILE 1
#define KEPT_TRIES 3 /* to write the file while others write it, too */
#define KEPT_EVERY_SECONDS 60.0
#define HASH_LETTERS 64
#define CLOCK_WORDS ((int64_t)(sizeof(GridClock) / 8))
#define FOUND_WORDS ((int64_t)(sizeof(Found) / 8))
#define DRAFT_ROOM 4096  /* bytes of a name */
#define DRAFT ".part"    /* what the name of the file has more that is written beside it */

typedef struct {
    const char *path; /* NULL: no run is kept */
    char draft[DRAFT_ROOM];
    time_t written;
    int64_t detections, accepted; /* when it was written last */
    int is_failing;
    Stamp stamp; /* of the file when it was read or written last */
    GridClock clock;
} Keeper;

/* A file that is read or written, with the checksum of what has passed, and whether all of it did. */
typedef struct {
    FILE *file;
    uint32_t sum;
    int is_good;
} KeptFile;

/* CRC-32 (IEEE 802.3), four bits at a time; begins with all bits set, and ends with them turned over. */
static uint32_t sum_of(uint32_t sum, const uint8_t *bytes, size_t n)
{
    uint32_t table[16];
    for (uint32_t k = 0; k < 16; k++) {
        table[k] = k;
        for (int bit = 0; bit < 4; bit++) table[k] = table[k] >> 1 ^ (table[k] & 1u ? 0xedb88320u : 0u);
    }
    for (size_t k = 0; k < n; k++) {
        sum = sum >> 4 ^ table[(sum ^ bytes[k]) & 15u];
        sum = sum >> 4 ^ table[(sum ^ (uint32_t)(bytes[k] >> 4)) & 15u];
    }
    return sum;
}

static void put_bytes(KeptFile *kept, const uint8_t *bytes, size_t n)
{
    kept->sum = sum_of(kept->sum, bytes, n);
    kept->is_good = kept->is_good && fwrite(bytes, 1, n, kept->file) == n;
}

static void get_bytes(KeptFile *kept, uint8_t *bytes, size_t n)
{
    kept->is_good = kept->is_good && fread(bytes, 1, n, kept->file) == n;
    if (kept->is_good) kept->sum = sum_of(kept->sum, bytes, n);
}

static void put_word(KeptFile *kept, uint64_t word)
{
    uint8_t bytes[8];
    for (int k = 0; k < 8; k++) bytes[k] = (uint8_t)(word >> (8 * k) & 255u);
    put_bytes(kept, bytes, 8);
}

/* The next word; 0 where there is none. */
static uint64_t get_word(KeptFile *kept)
{
    uint8_t bytes[8];
    uint64_t word = 0;
    get_bytes(kept, bytes, 8);
    for (int k = 0; k < 8 && kept->is_good; k++) word |= (uint64_t)bytes[k] << (8 * k);
    return word;
}

/* Numbers of eight bytes, n of them. */
static void put_numbers(KeptFile *kept, const void *numbers, int64_t n)
{
    for (int64_t k = 0; k < n; k++) {
        uint64_t word;
        memcpy(&word, (const char *)numbers + 8 * k, 8);
        put_word(kept, word);
    }
}

static void get_numbers(KeptFile *kept, void *numbers, int64_t n)
{
    for (int64_t k = 0; k < n; k++) {
        const uint64_t word = get_word(kept);
        memcpy((char *)numbers + 8 * k, &word, 8);
    }
}

static void put_run(KeptFile *kept, const GridClock *clock, const Found *found, const uint8_t *saved)
{
    put_word(kept, KEPT_MARK);
    put_word(kept, KEPT_FORMAT);
    put_bytes(kept, (const uint8_t *)PLANT_SHA256, HASH_LETTERS);
    put_word(kept, (uint64_t)CLOCK_WORDS);
    put_word(kept, (uint64_t)FOUND_WORDS);
    put_word(kept, (uint64_t)fb_saved_size());
    put_numbers(kept, clock, CLOCK_WORDS);
    put_numbers(kept, found, FOUND_WORDS);
    put_bytes(kept, saved, (size_t)fb_saved_size());
    put_word(kept, ~kept->sum);
}

/* Whether others have written the file since it was read or written last. */
static int is_replaced(const Keeper *keeper)
{
    const Stamp now = system_stamp(keeper->path), *before = &keeper->stamp;
    if (!now.number && !now.time) return 0; /* it is gone */
    return now.time != before->time || now.number != before->number || now.size != before->size;
}

/* Write a run to the draft and put it into its place; 0, KEPT_MEANWHILE where others have written the file meanwhile, unless
   that is to be written over, or SYSTEM_FAILED. */
static int write_kept(const Keeper *keeper, const Found *found, const uint8_t *saved, int is_over)
{
    KeptFile kept = {fopen(keeper->draft, "wb"), 0xffffffffu, 1};
    if (!kept.file) return SYSTEM_FAILED;
    put_run(&kept, &keeper->clock, found, saved);
    const int is_settled = kept.is_good && system_settle(kept.file) == 0;
    const int why = errno;
    const int is_closed = fclose(kept.file) == 0;
    if (is_settled && is_closed)
        return !is_over && is_replaced(keeper) ? KEPT_MEANWHILE : system_replace(keeper->draft, keeper->path);
    if (!is_settled) errno = why;
    return SYSTEM_FAILED;
}

/* Whether a clock and what was found can be those of a run: what they say of rows goes into tables as a place. */
static int is_of_a_run(const GridClock *clock, const Found *found)
{
    const Counts *counts = &clock->counts;
    int good = clock->n_placed >= 1 && clock->n_placed <= LAST_ROWS && clock->n_firsts >= 0 && clock->n_firsts <= KEPT_FIRSTS;
    good &= clock->last_index == counts->samples - 1 && clock->origin_index >= 0 && clock->origin_index <= clock->last_index;
    good &= isfinite(clock->origin_time) && isfinite(clock->last_time) && clock->usual >= 0.0;
    for (int64_t k = 0; good && k < clock->n_placed; k++)
        good &= isfinite(clock->placed[k].time) && (k == 0 || clock->placed[k].time >= clock->placed[k - 1].time);
    good &= counts->missing >= 0 && counts->late >= 0 && counts->duplicate >= 0 && counts->untimed >= 0 && counts->unused >= 0;
    good &= counts->clock_jumps >= 0 && counts->saturated >= 0 && counts->frozen >= 0;
    good &= found->watched >= 0 && found->waiting >= 0 && found->wild >= 0 && found->outside >= 0 && found->sensors_outside >= 0;
    return good && found->detections >= 0 && found->accepted >= 0 && found->rejected >= 0;
}

enum { KEPT_NOT, KEPT_GOOD, KEPT_STRANGE, KEPT_OTHER };

/* Read a run: KEPT_GOOD, KEPT_NOT where there is no file, or why it is refused. saved: of the core, as bytes. */
static int read_kept(const char *path, GridClock *clock, Found *found, uint8_t *saved)
{
    char hash[HASH_LETTERS];
    KeptFile kept = {fopen(path, "rb"), 0xffffffffu, 1};
    if (!kept.file) return errno == ENOENT ? KEPT_NOT : KEPT_STRANGE;
    int result = KEPT_STRANGE;
    if (get_word(&kept) == KEPT_MARK && get_word(&kept) == KEPT_FORMAT) {
        get_bytes(&kept, (uint8_t *)hash, HASH_LETTERS);
        if (kept.is_good && memcmp(hash, PLANT_SHA256, HASH_LETTERS) != 0) result = KEPT_OTHER;
        else if (get_word(&kept) == (uint64_t)CLOCK_WORDS && get_word(&kept) == (uint64_t)FOUND_WORDS &&
                 get_word(&kept) == (uint64_t)fb_saved_size()) {
            get_numbers(&kept, clock, CLOCK_WORDS);
            get_numbers(&kept, found, FOUND_WORDS);
            get_bytes(&kept, saved, (size_t)fb_saved_size());
            const uint32_t sum = ~kept.sum;
            const int is_whole = get_word(&kept) == sum && kept.is_good && getc(kept.file) == EOF;
            if (is_whole && is_of_a_run(clock, found)) result = KEPT_GOOD;
        }
    }
    (void)fclose(kept.file);
    return result;
}

/* Heed what a person has decided in the file of the alarm that is open. What the core saved last is lost. */
static void heed_kept(Keeper *keeper, Course *course)
{
    static GridClock clock;
    static Found other;
    keeper->stamp = system_stamp(keeper->path);
    if (!course->found.is_open) return;
    if (read_kept(keeper->path, &clock, &other, course->plant->memory.saved) == KEPT_GOOD) course_heed(course, &other);
}

/* Write the file, and again where others have written it meanwhile; 0, or SYSTEM_FAILED. */
static int write_heeding(Keeper *keeper, Course *course)
{
    const PlantMemory *memory = &course->plant->memory;
    int result = KEPT_MEANWHILE;
    for (int tries = 1; result == KEPT_MEANWHILE && tries <= KEPT_TRIES; tries++) {
        heed_kept(keeper, course);
        fb_save(memory->state, memory->saved);
        errno = 0;
        result = write_kept(keeper, &course->found, memory->saved, tries == KEPT_TRIES);
    }
    const int why = errno;
    keeper->stamp = system_stamp(keeper->path);
    errno = why;
    return result;
}

/* Keep the run as it is: `clock` is of the same moment as the state of the core. Where that cannot be, say so once, and at the
   end, and go on. */
static void keep_run(Keeper *keeper, const GridClock *clock, Course *course, int is_last)
{
    keeper->clock = *clock;
    keeper->written = time(NULL);
    const int is_failing = write_heeding(keeper, course);
    keeper->detections = course->found.detections;
    keeper->accepted = course->found.accepted;
    if (is_failing) {
        const char *why = errno ? strerror(errno) : "it cannot be written";
        if (is_last || !keeper->is_failing)
            fprintf(stderr, "faultbond: %s: the run cannot be kept (%s)%s.\n", keeper->path, why,
                    is_last ? "" : "; it goes on and tries again");
        keeper->is_failing = 1;
        (void)remove(keeper->draft);
        return;
    }
    if (keeper->is_failing) fprintf(stderr, "faultbond: %s: the run is kept again.\n", keeper->path);
    keeper->is_failing = 0;
}

/* Whether it is time to keep the run: at an alarm, where something was accepted, where a person decided in the file, and where the
   last time is long ago. */
static int is_keeping_due(const Keeper *keeper, const Found *found)
{
    const double ago = difftime(time(NULL), keeper->written);
    const int is_new = keeper->detections != found->detections || keeper->accepted != found->accepted;
    return is_new || ago < 0.0 || ago >= KEPT_EVERY_SECONDS || (found->is_open && is_replaced(keeper));
}

/* Say one line of what is wrong with the file; gives the exit code of a user's mistake. */
static int refuse_kept(const Keeper *keeper, const char *what)
{
    fprintf(stderr, "%s: %s\n", keeper->path, what);
    return 2;
}

/* Begin to keep a run in a file, and take what is kept there; exit code, or 0. goes_on: whether there was a run. */
static int keeper_begin(Keeper *keeper, const char *path, const PlantMemory *memory, Found *found, int *goes_on)
{
    memset(keeper, 0, sizeof *keeper);
    *goes_on = 0;
    keeper->path = path;
    if (!path) return 0;
    if (strlen(path) + sizeof DRAFT > DRAFT_ROOM) return refuse_kept(keeper, "this name is too long. Name another file.");
    strcpy(keeper->draft, path);
    strcat(keeper->draft, DRAFT);
    keeper->written = time(NULL);
    keeper->stamp = system_stamp(path);
    int kept = read_kept(path, &keeper->clock, found, memory->saved);
    if (kept == KEPT_GOOD && fb_restore(memory->state, memory->saved, fb_saved_size())) kept = KEPT_STRANGE;
    if (kept == KEPT_STRANGE)
        return refuse_kept(keeper, "this is not a state that this program saved, or it is damaged. Name another file, or delete it "
                                   "to begin anew.");
    if (kept == KEPT_OTHER)
        return refuse_kept(keeper, "it was saved with another model, or another form of this one. Take the program that saved it, "
                                   "or delete it to begin anew.");
    *goes_on = kept == KEPT_GOOD;
    FILE *draft = fopen(keeper->draft, "wb"); /* better known now than after a day */
    if (!draft) {
        fprintf(stderr, "%s: no run can be kept there: %s. Name another file.\n", path, strerror(errno));
        return 2;
    }
    (void)fclose(draft);
    (void)remove(keeper->draft);
    keeper->detections = *goes_on ? found->detections : 0;
    keeper->accepted = *goes_on ? found->accepted : 0;
    return 0;
}

#endif
