// The page /metrics: Prometheus' text format 0.0.4, SI base units. A value that is not known is NaN, never the last one.
#pragma once
#include <string>

#include "node/web/source.hpp"

namespace tactiled::web {

std::string metrics_text(const View& view, const std::string& node_name, std::size_t streams);

}  // namespace tactiled::web
