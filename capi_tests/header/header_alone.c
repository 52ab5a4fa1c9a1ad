/* The header is self-contained: nothing is included before it. Types, constants and prototypes can be
 * used in C and in C++; no library is linked. */
#include "switchback.h"
#include "switchback.h"

#if SWB_VERSION_MAJOR != 0 || SWB_VERSION_MINOR < 1 || SWB_VERSION_PATCH < 0
#error "version macros"
#endif

int64_t again(const swb_settings *settings);

static void log_line(int64_t level, const char *line, void *user_data)
{
    (void)level;
    (void)line;
    (void)user_data;
}

int main(void)
{
    swb_settings settings;
    swb_status status = SWB_OK;
    swb_log_fn log = log_line;

    settings.struct_size = sizeof settings;
    settings.cross = SWB_CROSS_FULL;
    log(SWB_LOG_LEVEL_INFO, SWB_VERSION, (void *)0);
    return status != SWB_OK || again(&settings) != SWB_CROSS_FULL;
}
