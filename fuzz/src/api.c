#include "api.h"

#include "api_table.h"

size_t element_size(int element)
{
    static const size_t sizes[] = {sizeof(double), sizeof(int64_t), sizeof(int32_t), 1, 1};
    return sizes[element];
}
