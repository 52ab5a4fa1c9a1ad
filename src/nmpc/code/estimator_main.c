/* Repeats what the library's estimator made of recorded measurements: the same measurements give the same states. */
#include "@prefix@.h"
#include "@prefix@_record.h"

#include <math.h>
#include <stdio.h>

/* What the rounding of other sums may change, relative to the largest state: the kernel adds in another order than the library. */
#ifndef TOLERANCE
#define TOLERANCE (sizeof(@prefix@_real) == sizeof(double) ? 1e-9 : 2e-2)
#endif

int main(void) {
    double worst = 0.0;
    int k, i, sources = 0, most = 0;
    for (k = 0; k < SAMPLES; k++) {
        @prefix@_real x[@prefix@_nx];
        if (k > 0)
            @prefix@_prepare(&RECORD_U[k * @prefix@_nu]);
        if (@prefix@_estimate(&RECORD_Y[k * @prefix@_ny], x) != RECORD_SOURCE[k])
            sources++;
        for (i = 0; i < @prefix@_nx; i++) {
            const double off = fabs((double)x[i] - (double)RECORD_X[k * @prefix@_nx + i]) / RECORD_LARGEST[i];
            if (!(off <= worst))
                worst = off;
        }
        i = @prefix@_iterations();
        most = i > most ? i : most;
    }
    printf("%d samples: largest difference %.1e of the largest state, %d other sources, at most %d steps, %lu bytes\n", SAMPLES, worst,
           sources, most, @prefix@_arena_bytes);
    return worst <= TOLERANCE && sources == 0 ? 0 : 1;
}
