// The C++ header is self-contained and can be in several translation units.
#include "switchback.hpp"
#include "switchback.hpp"

int main() { return static_cast<int>(swb::View{}.size()); }
