// An array of taxels in words, as JSON and as a map of characters: shared by read, top and the web page.
#pragma once
#include <array>
#include <string>
#include <vector>

#include "tactiled/reader.hpp"

namespace tactiled::ctl {

// The bits of a taxel's state (enum tactiled_taxel_state), from bit 0 on.
inline constexpr std::array<const char*, 6> kTaxelStates = {"missing", "saturated", "dead", "frozen", "outside", "doubted"};

// Returns the press along a normal of the measured components (bits 0..2) of a force.
float press_N(std::uint32_t components, const float* force_S_N, const float* normal_S);
// Returns the press on taxel i along its normal, N, from the components that are measured; NaN without one.
float press_N(const SegmentView& segment, std::uint32_t sensor, const Array& array, std::uint32_t i);

// Appends the keys of an array to a JSON object that has begun: `{"schema":1,...`, with a comma after the last one.
void append_array_json(const SegmentView& segment, std::uint32_t sensor, const Array& array, std::string& out);
// Appends the keys that do not change while the segment exists: shape and places.
void append_places_json(const SegmentView& segment, std::uint32_t sensor, std::string& out);

// Lines with quality, centre of pressure, area and peak, then the press on each taxel: the rows of a grid, or a list.
std::string array_table(const SegmentView& segment, std::uint32_t sensor, const Array& array);
// One line for each taxel, without a header.
inline constexpr const char* kArrayCsvHeader = "t_s,taxel,x_m,y_m,z_m,fx_N,fy_N,fz_N,state,quality\n";
void append_array_csv(const SegmentView& segment, std::uint32_t sensor, const Array& array, std::string& out);

// ---- heat_map.cpp ----

enum class Ink { plain, colours };  // colours: 256 of them, and half blocks
// Returns the colours of the standard output: plain without a terminal, colours or UTF-8.
Ink ink_of_output();

// The press as seen from outside: x to the right, y up, projected along z. Above the map are the name, the scale with the
// number of taxels without a force, and the centre of pressure. A BAD array has no map. Each line is `width` columns wide;
// at most kMapHead + `height` lines.
inline constexpr std::size_t kMapHead = 3;
std::vector<std::string> heat_map(const SegmentView& segment, std::uint32_t sensor, const Array& array, unsigned width,
                                  unsigned height, Ink ink);
// One line with the marks of a map.
std::string heat_map_legend(Ink ink);

}  // namespace tactiled::ctl
