#include "decoupling/patch/places.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "drivers/taxels.hpp"

namespace tactiled {
namespace {

using Axis = std::array<float, 3>;

Axis scaled(const Axis& a, float by) { return {a[0] * by, a[1] * by, a[2] * by}; }
float dot(const Axis& a, const Axis& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Axis cross(const Axis& a, const Axis& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

// Row 0 has the largest y and column 0 the smallest x, as on a picture of the skin; S is in the middle.
void put_grid(const CalibrationData& data, TaxelPlaces& places) {
    const double x_mm = data["pitch_mm"], y_mm = data["pitch_y_mm"] > 0 ? data["pitch_y_mm"] : x_mm;
    for (std::size_t i = 0; i < places.n; ++i) {
        const double row = double(i / places.columns), column = double(i % places.columns);
        places.x.push_back(float((column - (places.columns - 1) / 2.) * x_mm * 1e-3));
        places.y.push_back(float(((places.rows - 1) / 2. - row) * y_mm * 1e-3));
        places.z.push_back(0);
    }
    places.pitch_m = {float(x_mm * 1e-3), float(y_mm * 1e-3), 0};
    if (!data.has("taxel_area_mm2")) places.taxel_area_m2 = float(x_mm * y_mm * 1e-6);
}

void put_list(const NumberRows& table, TaxelPlaces& places) {
    for (const auto& row : table) {
        places.x.push_back(float(row[0] * 1e-3));
        places.y.push_back(float(row[1] * 1e-3));
        places.z.push_back(float(row[2] * 1e-3));
    }
}

// z of a taxel's frame is its normal, and x lies in the plane of the normal and the x of S (of y, along x).
std::string put_axes(const NumberRows& normals, TaxelPlaces& places) {
    if (normals.size() != places.n) return fmt::format("table normal has {} rows for {} taxels", normals.size(), places.n);
    for (std::size_t i = 0; i < places.n; ++i) {
        Axis z{float(normals[i][0]), float(normals[i][1]), float(normals[i][2])};
        const float length = std::sqrt(dot(z, z));
        if (!(length > 0)) return fmt::format("table normal: row {} has the length 0", i);
        z = scaled(z, 1 / length);
        const bool along_x = std::abs(z[0]) > 0.9f;
        const Axis toward = along_x ? Axis{0, 1, 0} : Axis{1, 0, 0};
        Axis x{toward[0] - dot(toward, z) * z[0], toward[1] - dot(toward, z) * z[1], toward[2] - dot(toward, z) * z[2]};
        x = scaled(x, 1 / std::sqrt(dot(x, x)));
        places.normal[i] = z;
        places.axes.push_back({x, cross(z, x), z});
    }
    return "";
}

// Puts taxel i of the device at place wiring[i].
std::string rewire(const std::vector<double>& wiring, TaxelPlaces& places) {
    std::vector<std::size_t> order;
    for (const double at : wiring) {
        if (!(at >= 0 && at < double(places.n)) || at != std::floor(at))
            return fmt::format("table wiring has {}; a place is 0 .. {}", at, places.n - 1);
        order.push_back(std::size_t(at));
    }
    std::vector<std::size_t> sorted = order;
    std::sort(sorted.begin(), sorted.end());
    if (sorted.size() != places.n || std::adjacent_find(sorted.begin(), sorted.end()) != sorted.end())
        return fmt::format("table wiring has {} numbers; each of the {} places is needed once", order.size(), places.n);
    const auto reorder = [&](auto& list) {
        if (list.empty()) return;
        auto before = list;
        for (std::size_t i = 0; i < order.size(); ++i) list[i] = before[order[i]];
    };
    reorder(places.x), reorder(places.y), reorder(places.z), reorder(places.normal), reorder(places.axes);
    if (!std::is_sorted(order.begin(), order.end())) places.rows = places.columns = 0;  // the order is not that of a grid
    return "";
}

// The neighbours of a taxel are the nearest ones, up to kNeighbours, at up to this multiple of the nearest one's distance:
// in a grid, with distances relative to its pitches, those beside it and not those across its corners.
constexpr float kReach = 1.3f;

// The taxel lies between two neighbours if the middle of these is nearer to it than half of the way to the nearest one.
void put_between(const TaxelPlaces& places, std::size_t i, float nearest, const Axis& unit, TaxelPlaces::Neighbours& of) {
    for (std::size_t k = 0; k < of.n; ++k)
        for (std::size_t m = k + 1; m < of.n && of.n_between < of.between.size(); ++m) {
            const std::size_t a = of.of[k], b = of.of[m];
            const Axis middle{((places.x[a] + places.x[b]) / 2 - places.x[i]) / unit[0],
                              ((places.y[a] + places.y[b]) / 2 - places.y[i]) / unit[1],
                              (places.z[a] + places.z[b]) / 2 - places.z[i]};
            if (std::sqrt(dot(middle, middle)) < nearest / 2) of.between[of.n_between++] = {of.of[k], of.of[m]};
        }
}

void put_neighbours(TaxelPlaces& places) {
    std::vector<std::pair<float, std::uint16_t>> near;
    std::vector<float> nearest;
    const bool is_grid = places.pitch_m[0] > 0;
    const float wide = is_grid ? places.pitch_m[0] : 1, high = is_grid ? places.pitch_m[1] : 1;
    for (std::size_t i = 0; i < places.n; ++i) {
        near.clear();
        for (std::size_t j = 0; j < places.n; ++j) {
            const float dx = (places.x[j] - places.x[i]) / wide, dy = (places.y[j] - places.y[i]) / high,
                        dz = places.z[j] - places.z[i];
            if (j != i) near.emplace_back(std::sqrt(dx * dx + dy * dy + dz * dz), std::uint16_t(j));
        }
        const std::size_t most = std::min(near.size(), TaxelPlaces::kNeighbours);
        std::partial_sort(near.begin(), near.begin() + std::ptrdiff_t(most), near.end());
        TaxelPlaces::Neighbours& of = places.neighbours.emplace_back();
        while (of.n < most && near[of.n].first <= kReach * near[0].first) of.of[of.n] = near[of.n].second, ++of.n;
        if (most == 0) continue;
        nearest.push_back(near[0].first);
        put_between(places, i, near[0].first, {wide, high, 1}, of);
    }
    if (is_grid || nearest.empty()) return;
    std::nth_element(nearest.begin(), nearest.begin() + std::ptrdiff_t(nearest.size() / 2), nearest.end());
    places.pitch_m.fill(nearest[nearest.size() / 2]);
    if (places.is_flat()) places.pitch_m[2] = 0;
}

}  // namespace

TaxelPlaces places_of(const CalibrationData& data, std::string& fault) {
    TaxelPlaces places;
    const NumberRows* const list = data.table("place_mm");
    const bool is_grid = data.has("rows") && data.has("columns") && data.has("pitch_mm");
    if (is_grid == (list != nullptr)) {
        fault =
            "the places of the taxels are missing, or given twice: parameters rows, columns, pitch_mm, or table place_mm";
        return places;
    }
    if (data["rows"] != std::floor(data["rows"]) || data["columns"] != std::floor(data["columns"])) {
        fault = "rows and columns are whole numbers";
        return places;
    }
    places.rows = std::uint32_t(data["rows"]);
    places.columns = std::uint32_t(data["columns"]);
    places.n = list != nullptr ? list->size() : std::size_t(places.rows) * places.columns;
    if (places.n > kMaxTaxels) {
        fault = fmt::format("{} taxels; an array has at most {}", std::exchange(places.n, 0), kMaxTaxels);
        return places;
    }
    places.taxel_area_m2 =
        data.has("taxel_area_mm2") ? float(data["taxel_area_mm2"] * 1e-6) : std::numeric_limits<float>::quiet_NaN();
    if (list != nullptr)
        put_list(*list, places);
    else
        put_grid(data, places);
    places.normal.assign(places.n, {0, 0, 1});
    if (const NumberRows* normals = data.table("normal")) fault = put_axes(*normals, places);
    if (const NumberRows* wiring = data.table("wiring"); wiring != nullptr && fault.empty())
        fault = rewire(wiring->front(), places);
    put_neighbours(places);
    return places;
}

}  // namespace tactiled
