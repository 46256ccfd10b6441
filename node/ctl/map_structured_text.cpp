#include "node/ctl/map_text.hpp"
namespace tactiled::ctl {
std::string map_structured_text(unsigned) { return ""; }
}  // namespace tactiled::ctl
