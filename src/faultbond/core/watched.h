/* What is remembered of a plant that is watched: numbers of one plant, or of FB_LANES assets side by side. This text is
   included for both, where `real` and `whole` stand for the numbers of one, or for lanes of them. */

/* Where the run stands, in samples; -1: not yet. */
typedef struct {
    whole index;      /* samples seen */
    whole begun;      /* first sample with a value of every input */
    whole running;    /* 1 once the filter runs */
    whole alarm;      /* sample of the alarm */
    whole detections; /* alarms so far */
    whole accepted;   /* sample at which a diagnosis was accepted last, */
    whole over;       /* and at which an alarm was over by itself */
    whole silent;     /* samples without any value, up to this one */
    whole quiet;      /* 1: no alarm is raised, as where a model is tried; 2: ALARMS_ONLY */
    whole outside;    /* samples up to this one at which the model did not hold */
    real doubt;       /* factor on the variances of the noise, since the states are sought where the model holds again; 0: none */
    real pause;       /* usual number of silent ones before a sample with a value; where rows are the grid, usual s between rows */
    real time;        /* s */
} Clock;

/* What is known of the inputs, SI. */
typedef struct {
    real held[FB_ROOM(N_INPUTS)];       /* last values */
    real earlier[FB_ROOM(N_INPUTS)];    /* those of the sample before */
    real lowest[FB_ROOM(N_INPUTS)];     /* least value that was seen; inf: none yet */
    real highest[FB_ROOM(N_INPUTS)];
    real leap[FB_ROOM(N_INPUTS)];       /* usual change from one sample to the next, root of a mean of squares */
    real guessed[FB_ROOM(N_INPUTS)];    /* samples since each was told */
    real habit[FB_ROOM(N_INPUTS)];      /* part of the samples with any value in which each is told */
    real since_step[FB_ROOM(N_INPUTS)]; /* s since the last step */
    real change[FB_ROOM(N_AFTER)];      /* change of an input that a slow error still feels, entry by entry of AFTER_INPUT */
    real odd[FB_ROOM(N_INPUTS)];        /* value that was refused at the last sample; nan: none was */
    real true_for[FB_ROOM(N_CONDITIONS)]; /* s since each condition became true again; -1: it is not, inf: it has settled */
    real trends[FB_ROOM(N_SMOOTH)][TRENDS][TREND_NUMBERS]; /* what follows records that scatter, see smooth.h, */
    real rough[FB_ROOM(N_SMOOTH)];      /* and the variance of what is left of their noise, in that; 0: not told yet */
#if N_NOISY > 0
    real record[N_NOISY];               /* of records that scatter: the last value, as it was told; nan: none yet, */
    real still[N_NOISY];                /* samples up to this one for which it has been the same, but for those that lack it, */
    real stood[N_NOISY];                /* the most of these up to the alarm, but for those at an end of where it had been, */
    real idle[N_NOISY];                 /* samples at such an end until then: it may have been at rest there, */
    real since[N_NOISY];                /* s, when it moved last, */
    real turns[N_NOISY];                /* how often it turned back within until then, */
    real way[N_NOISY];                  /* and where it moved last: 1 up, -1 down; 0: it has not moved yet */
#endif
    real inside[FB_ROOM(N_INPUTS)];     /* where the model does not hold: last values for which it did; nan: none */
    whole odd_since;                    /* sample at which the first of these was refused */
    real rival[PLAIN_NUMBERS];          /* the healthy filter as it is if they are real, */
    real gain;                          /* and by how much the readings have spoken for it, sd^2 */
} Inputs;

/* What is known of the sensors, and the sums of the detector; a side is up (0) or down (1). */
typedef struct {
    real shown[2][N_OUTPUTS];            /* least and greatest reading, SI */
    real spent[N_OUTPUTS];               /* patience with wild values that is used up */
    real surprised;                      /* 1: a reading of the last sample was wild, or an input before it, see spikes.h */
    real nis[N_OUTPUTS];                 /* usual square of a normalised innovation while healthy; 1: as declared */
    real mean[N_OUTPUTS];                /* of the last normalised innovations, */
    real run[N_OUTPUTS];                 /* and their variance over long runs while healthy; 1: they are white */
    real cusum[2][N_OUTPUTS];            /* slow sums, */
    real cusum_start[2][N_OUTPUTS];      /* and the sample after which each began to grow */
    real fast[2][N_OUTPUTS];             /* sums with the larger drift */
    real scatter[LAGS][N_OUTPUTS];       /* sums of the scatter */
    real scatter_start[LAGS][N_OUTPUTS];
    real before[LAGS][N_OUTPUTS];        /* last innovations in their sd, the newest first; nan: none */
} Sensors;

/* The healthy filter. */
typedef struct {
    real lane[PLAIN_NUMBERS];
    real travel[2][FB_ROOM(N_STATES)];      /* least and greatest value of each state, */
    real astray[FB_ROOM(N_STATES)];         /* and the sd that is left of a gap */
    real windows[WALKS];                    /* windows over which parameters were seen to walk, of each length, */
    real walks[WALKS][N_PARAMETERS + 1];    /* and the sums of the squares of how far, in what their variances allow: of each, and
                                               the mean of all together */
    real walk;                              /* the largest walk at this sample, in its limit; 0: none is judged, */
    real walker;                            /* and whose it is: parameter + N_PARAMETERS * window, WALKS: since the start,
                                               WALKS + 1 and more: of all together over a window, of which it walked farthest */
    real blind;                             /* the last sample at which some input was unknown, see `any_unknown` */
    real snapshots[SNAPSHOTS][KEPT_NUMBERS]; /* the lane now and then, see walking.h */
} Healthy;

/* All of it; a state begins with the same parts. */
typedef struct {
    Clock clock;
    Inputs inputs;
    Sensors sensors;
    Healthy healthy;
} Watched;

/* One grid point: s, and s since the one before, which all assets share; SI; nan: missing. */
typedef struct {
    double time, dt;
    real u[FB_ROOM(N_INPUTS)], y[N_OUTPUTS];
    real record[FB_ROOM(N_NOISY)]; /* of noisy inputs as they were told, */
    real fade[FB_ROOM(N_NOISY)], fresh[FB_ROOM(N_NOISY)]; /* and of their errors, see `smooth_inputs` */
} Sample;
