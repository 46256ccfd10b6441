// The texts of the server. The event stream is between this server and its own page; programs use /api/status.
#pragma once
#include <string>

#include "node/web/history.hpp"
#include "node/web/source.hpp"
#include "node/web/timeline.hpp"

namespace tactiled::web {

// Event "hello": names, ranges and words, which stay until View::structure changes.
std::string hello_message(const View& view, const std::string& run, bool has_commands);
// Event "past": the history of one sensor.
void append_past(const View& view, const History& history, std::uint32_t sensor, std::string& out);
// Event "changes": of the time-line, those after `revision`; returns the newest.
std::uint64_t append_changes(const Timeline& timeline, std::uint64_t revision, std::string& out);
// An event without a name: the values of one tick. With `links`, the counters of the links, too.
std::string frame_message(const View& view, bool links);

// /api/status: the object of `tactilectl status --json` with more keys; api.schema.json describes it.
std::string status_body(const View& view, const std::string& node_name);
std::string events_body(const Timeline& timeline);
// /api/array: the object of `tactilectl read SENSOR --array --json` with more keys; /api/places: what does not change.
std::string array_body(const View& view, std::uint32_t sensor);
std::string places_body(const View& view, std::uint32_t sensor);
// Returns the index of the sensor with taxels of that name, or -1.
int find_array(const View& view, const std::string& sensor);

// The page /metrics: Prometheus' text format 0.0.4, SI base units. A value that is not known is NaN, never the last one.
std::string metrics_text(const View& view, const std::string& node_name, std::size_t streams);

}  // namespace tactiled::web
