/* Repeats the loop that was recorded with the library's controller: the same states give the same controls. */
#include "@prefix@.h"
#include "@prefix@_record.h"

#include <math.h>
#include <stdio.h>

/* What the rounding of other sums may change, relative to the largest control: the kernel adds in another order than the library. */
#ifndef TOLERANCE
#define TOLERANCE (sizeof(@prefix@_real) == sizeof(double) ? 1e-10 : 2e-2)
#endif

int main(void) {
    double worst = 0.0;
    int k, j, sources = 0, most = 0, i;
    for (k = 0; k < SAMPLES; k++) {
        @prefix@_real u[@prefix@_nu];
        @prefix@_prepare();
        if (@prefix@_feedback(&RECORD_X[k * @prefix@_nx], u) != RECORD_SOURCE[k])
            sources++;
        for (j = 0; j < @prefix@_nu; j++) {
            const double off = fabs((double)u[j] - (double)RECORD_U[k * @prefix@_nu + j]) / RECORD_LARGEST;
            if (!(off <= worst))
                worst = off;
        }
        i = @prefix@_iterations();
        most = i > most ? i : most;
    }
    printf("%d samples: largest difference %.1e of the largest control, %d other sources, at most %d steps, %lu bytes\n", SAMPLES,
           worst, sources, most, @prefix@_arena_bytes);
    return worst <= TOLERANCE && sources == 0 ? 0 : 1;
}
