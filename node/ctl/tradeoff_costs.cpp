#include <fmt/format.h>

#include "config/options.hpp"
#include "node/ctl/tradeoff.hpp"

namespace tactiled::ctl {

int tradeoff_costs(const std::string& name, const TradeoffOutput&) {
    throw SetupError(fmt::format("--cost {}: there is none of that name", name));
}

}  // namespace tactiled::ctl
