/* Header and library are of one version. */
#include "check.h"

int main(void)
{
    char text[32];

    sprintf(text, "%d.%d.%d", SWB_VERSION_MAJOR, SWB_VERSION_MINOR, SWB_VERSION_PATCH);
    CHECK_TEXT(text, swb_version());
    CHECK_TEXT(text, SWB_VERSION);
    CHECK(swb_abi_version() == (SWB_VERSION_MAJOR == 0 ? SWB_VERSION_MINOR : 1000 * SWB_VERSION_MAJOR));
    CHECK_OK(swb_check_version(SWB_VERSION_MAJOR, SWB_VERSION_MINOR));
    CHECK_STATUS(SWB_ERR_UNSUPPORTED, swb_check_version(SWB_VERSION_MAJOR, SWB_VERSION_MINOR + 1));
    CHECK_STATUS(SWB_ERR_UNSUPPORTED, swb_check_version(SWB_VERSION_MAJOR + 1, 0));
    CHECK(strstr(swb_last_error(), SWB_VERSION) != NULL);
    return CHECK_DONE();
}
