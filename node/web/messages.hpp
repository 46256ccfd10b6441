// Messages of the event stream to the page. The stream is between this server and its own page; programs use /api/status.
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

}  // namespace tactiled::web
