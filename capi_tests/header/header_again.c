/* The second translation unit: no definition of the header appears twice when both are linked. */
#include "switchback.h"

int64_t again(const swb_settings *settings);

int64_t again(const swb_settings *settings)
{
    return settings->cross;
}
