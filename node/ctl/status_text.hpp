// Shared by status and top.
#pragma once
#include <nlohmann/json.hpp>

#include "tactiled/reader.hpp"

namespace tactiled::ctl {

double age_ms(const tactiled_sample& s, std::uint64_t now_ns);
nlohmann::json status_json(const Segment& segment, const Snapshot& snapshot);
// The daemon lives, and every sensor has a value.
bool is_healthy(const Segment& segment, const Snapshot& snapshot);

}  // namespace tactiled::ctl
