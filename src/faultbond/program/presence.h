/* Which sensors and inputs gave a value, and for how long they gave none: what they would show was not watched then. */
#ifndef WATCH_PRESENCE_H
#define WATCH_PRESENCE_H

#include "names.h"
#include "point.h"

#define LEAST_SILENCE 60    /* samples without a value that are worth a word */
#define SHARE_OF_SILENCE 10 /* the longest silence is told where it is more than this part of the samples: a tenth */
#define HARDLY 20           /* so is a signal with less than this part of the values of the sensor with most: a twentieth */
#define N_HEARD (N_OUTPUTS + N_INPUTS) /* sensors, then inputs */

/* samples: that had any value. Of each signal: values: that it gave; last, last_time: sample and time of the last one; longest:
   samples of the longest silence that is over; since, until: times of the values before and after it. */
typedef struct {
    int64_t samples, values[N_HEARD], last[N_HEARD], longest[N_HEARD];
    double last_time[N_HEARD], since[N_HEARD], until[N_HEARD];
} Presence;

static inline void presence_begin(Presence *presence)
{
    memset(presence, 0, sizeof *presence);
    for (int k = 0; k < N_HEARD; k++) {
        presence->last[k] = -1;
        presence->last_time[k] = presence->since[k] = presence->until[k] = NAN;
    }
}

/* Take a sample; one without any value tells of a gap, not of a signal. */
static inline void presence_add(Presence *presence, double time, const double *inputs, const double *readings)
{
    int is_any = 0;
    for (int k = 0; k < N_HEARD; k++) {
        if (!isfinite(k < N_OUTPUTS ? readings[k] : inputs[k - N_OUTPUTS])) continue;
        const int64_t silence = presence->samples - presence->last[k] - 1;
        if (silence > presence->longest[k]) {
            presence->longest[k] = silence;
            presence->since[k] = presence->last_time[k];
            presence->until[k] = time;
        }
        presence->values[k]++;
        presence->last[k] = presence->samples;
        presence->last_time[k] = time;
        is_any = 1;
    }
    presence->samples += is_any;
}

/* Whether a signal gave no value, hardly any, or none for long. */
static inline int is_silent(const Presence *presence, int k)
{
    int64_t most = 1;
    for (int j = 0; j < N_OUTPUTS; j++) most = presence->values[j] > most ? presence->values[j] : most;
    const int64_t ending = presence->samples - 1 - presence->last[k];
    const int64_t longest = presence->longest[k] > ending ? presence->longest[k] : ending;
    const int is_long = longest > LEAST_SILENCE && longest * SHARE_OF_SILENCE > presence->samples;
    return presence->samples > 0 && (is_long || presence->values[k] * HARDLY < most);
}

/* The times of the values before and after the longest silence of a signal; nan: there is none. */
static inline void longest_silence(const Presence *presence, int k, double *since, double *until)
{
    const int is_last = presence->samples - 1 - presence->last[k] >= presence->longest[k];
    *since = is_last ? presence->last_time[k] : presence->since[k];
    *until = is_last ? NAN : presence->until[k];
}

static inline const char *signal_name(int k) { return k < N_OUTPUTS ? OUTPUT_NAMES[k] : INPUT_NAMES[k - N_OUTPUTS]; }

static inline const char *signal_role(int k) { return k < N_OUTPUTS ? "sensor" : "input"; }

/* Say of each silent signal how silent it was, and what follows. */
static inline void tell_silence(const Presence *presence)
{
    for (int k = 0; k < N_HEARD; k++) {
        double since, until;
        if (!is_silent(presence, k)) continue;
        longest_silence(presence, k, &since, &until);
        fprintf(stderr, "faultbond: the %s %s gave ", signal_role(k), signal_name(k));
        if (!presence->values[k]) {
            fprintf(stderr, "no value");
        } else {
            fprintf(stderr, "a value in %lld of %lld samples, none ", (long long)presence->values[k], (long long)presence->samples);
            if (isnan(since)) fprintf(stderr, "before %.15g s", until);
            else if (isnan(until)) fprintf(stderr, "from %.15g s on", since);
            else fprintf(stderr, "from %.15g s to %.15g s", since, until);
        }
        if (k >= N_OUTPUTS) fprintf(stderr, ": it is taken to have stayed as it was.\n");
        else fprintf(stderr, ": what only it would show was not watched%s.\n", presence->values[k] ? " then" : "");
    }
}

#endif
