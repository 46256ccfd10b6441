// /api/status: the object of `tactilectl status --json` with more keys; api.schema.json describes it.
#pragma once
#include <string>

#include "node/web/source.hpp"
#include "node/web/timeline.hpp"

namespace tactiled::web {

std::string status_body(const View& view, const std::string& node_name);
std::string events_body(const Timeline& timeline);

}  // namespace tactiled::web
