/* Reads lines `time,input..,reading..`, SI, in the order of faultbond.h, and says what it finds. */
#include <stdio.h>

#include "faultbond.h"

#define N_ROW (2 + N_INPUTS + N_OUTPUTS)

FB_ALIGNED static unsigned char state[FB_STATE_BYTES], work[FB_WORK_BYTES];
static Report report;
static Diagnosis found;

int main(void)
{
    double row[N_ROW], before = NAN; /* time, s since the sample before, inputs, readings */
    fb_init(state, 0.0, 0);
    while (scanf("%lf", &row[0]) == 1) {
        for (int k = 2; k < N_ROW; k++)
            if (scanf(" ,%lf", &row[k]) != 1) return 2;
        row[1] = before < row[0] ? row[0] - before : 0.0;
        before = row[0];
        if (!fb_step(state, work, row, &report, &found)) continue;
        if (report.detected) printf("%g s: a fault\n", row[0]);
        if (!report.due) continue;
        const Candidate *best = &found.candidates[0];
        for (int64_t k = 0; k < best->n_suspects; k++)
            printf("%g s: %s = %g, probability %.3f\n", row[0], fb_suspect_name(&best->suspects[k]),
                   best->suspects[k].estimate, best->probability);
    }
    return 0;
}
