/* Runs a core over a recording and writes the posteriors of all hypotheses. Before this text stand the model and the core,
   before them, where LONG is defined, long.h.

   RECORDING: rows of time, step, inputs and readings (double). OUT: at each diagnosis its sample, then a posterior of every
   hypothesis (double). */
#ifdef LONG
#undef double
typedef long double number;
#else
typedef double number;
#endif

#include <stdio.h>
#include <stdlib.h>

#define COLUMNS (2 + N_INPUTS + N_OUTPUTS)

static void write_posteriors(const State *state, const Ranking *ranking, FILE *out)
{
    const number best = ranking->score[leading_hypothesis(ranking)];
    double told[1 + N_HYPOTHESES];
    number total = 0.0;
    for (int64_t k = 0; k < N_HYPOTHESES; k++) total += exp(ranking->score[k] - best);
    told[0] = (double)(state->clock.index - 1);
    for (int64_t k = 0; k < N_HYPOTHESES; k++) told[1 + k] = (double)(exp(ranking->score[k] - best) / total);
    fwrite(told, sizeof told, 1, out);
}

int main(int n, char **words)
{
    static State state;
    static Diagnosis found;
    Work *work = (Work *)aligned_alloc(64, (sizeof(Work) + 63) / 64 * 64);
    FILE *recording = n > 2 ? fopen(words[1], "rb") : NULL, *out = n > 2 ? fopen(words[2], "wb") : NULL;
    double row[COLUMNS];
    number sample[COLUMNS];
    Report report;
    if (!recording || !out || !work) return 1;
    memset(work, 0, sizeof(Work));
    fb_init(&state, 0.0, 0);
    while (fread(row, sizeof row, 1, recording) == 1) {
        for (int k = 0; k < COLUMNS; k++) sample[k] = row[k];
        fb_step(&state, work, sample, &report, &found);
        if (report.due) write_posteriors(&state, &work->ranking.ranking, out);
    }
    fclose(recording);
    return fclose(out) != 0;
}
