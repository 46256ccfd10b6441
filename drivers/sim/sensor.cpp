#include "drivers/sim/sensor.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace tactiled::sim {
namespace {

struct Known {
    std::string_view name;
    Model model;
    void (*read)(Options&, Sensor&);
};
constexpr Known kModels[] = {{"table", Model::table, read_table},
                             {"hair", Model::hair, read_hair},
                             {"capacitive", Model::capacitive, read_capacitive},
                             {"taxel", Model::taxel, read_taxel}};

// 1 N in the channel's unit: see Sensor::per_N.
double per_newton(const Load& gain) {
    const double max = std::max({std::abs(gain[kFx]), std::abs(gain[kFy]), std::abs(gain[kFz])});
    double min = max;
    for (const Axis axis : {kFx, kFy, kFz})
        if (std::abs(gain[axis]) >= max / 10) min = std::min(min, std::abs(gain[axis]));
    return min;
}

// Makes one sensor per taxel, row by row from the corner with the smallest x and y.
std::vector<Sensor> as_array(const Sensor& one, std::size_t rows, std::size_t columns, double pitch_m) {
    std::vector<Sensor> taxels;
    for (std::size_t row = 0; row < rows; ++row)
        for (std::size_t column = 0; column < columns; ++column) {
            Sensor taxel = one;
            taxel.name = fmt::format("{}_{}_{}", one.name, row, column);
            taxel.x_m += (double(column) - double(columns - 1) / 2) * pitch_m;
            taxel.y_m += (double(row) - double(rows - 1) / 2) * pitch_m;
            taxel.serial += row * columns + column;
            taxel.half_width_m = pitch_m / 2;
            taxel.array_row = row;
            taxel.array_column = column;
            taxel.rows = rows;
            taxel.columns = columns;
            taxels.push_back(std::move(taxel));
        }
    return taxels;
}

}  // namespace

std::size_t Sensor::find(std::string_view channel) const {
    return std::size_t(std::find(channels.begin(), channels.end(), channel) - channels.begin());
}

Sensor Sensor::taxel_at(std::size_t i) const {
    Sensor one = *this;
    one.name = fmt::format("{}_{}_{}", name, i / columns, i % columns);
    one.serial += i;
    one.rows = one.columns = 1;
    return one;
}

double Sensor::channel_N(const Load& change) const {
    Channels reads{};
    for (std::size_t k = 0; k < n(); ++k)
        for (std::size_t axis = 0; axis < kAxes; ++axis) reads[k] += std::abs(gain[k][axis]) * change[axis];
    return largest_N(reads);
}

double Sensor::largest_N(const Channels& change) const {
    double max = 0;
    for (std::size_t k = 0; k < n(); ++k)
        if (per_N[k] > 0) max = std::max(max, std::abs(change[k]) / per_N[k]);
    return max;
}

std::vector<Sensor> read_sensor(Options& options) {
    Sensor sensor;
    sensor.name = options.text("name");
    std::vector<std::string> names;
    for (const Known& known : kModels) names.emplace_back(known.name);
    const std::string model = options.one_of("model", names);
    for (const Known& known : kModels)
        if (known.name == model) {
            sensor.model = known.model;
            known.read(options, sensor);
        }
    for (std::size_t k = 0; k < sensor.n(); ++k)  // a dummy has the amplifier and the noise of the first channel
        sensor.per_N[k] = per_newton(sensor.gain[sensor.is_dummy(k) ? 0 : k]);
    sensor.resolution_N = options.number("resolution_N", {1e-9, 1e3}, sensor.resolution_N);
    sensor.full_scale_N = options.number("full_scale_N", {1e-6, 1e5}, sensor.full_scale_N);
    sensor.serial = std::uint64_t(options.integer("serial", {0, 9e15}, 1));
    sensor.x_m = options.number("x_m", {-1, 1}, 0);
    sensor.y_m = options.number("y_m", {-1, 1}, 0);
    sensor.turn_rad = options.number("turn_deg", {-360, 360}, 0) * std::numbers::pi / 180;
    sensor.share = options.number("share", {0, 1}, 1);
    sensor.every = std::size_t(options.integer("every", {1, 100'000}, 1));
    const auto array = options.numbers("array", {1, 4}, {0, 2}), taxels = options.numbers("taxels", {1, 64}, {0, 2});
    const double pitch_m = options.number("pitch_m", {1e-4, 0.1}, 2e-3);
    const bool both = !array.empty() && !taxels.empty();
    if (both)
        options.problem("array", "array = [rows, columns] makes a device of each, taxels = [rows, columns] one of all");
    for (const auto& [key, shape] : {std::pair{"array", array}, {"taxels", taxels}})
        if (shape.size() == 1) options.problem(key, fmt::format("{} = [rows, columns]", key));
    if (sensor.model == Model::taxel && taxels.empty())
        options.problem("taxels", "model \"taxel\" needs taxels = [rows, columns]");
    if (taxels.size() == 2) {
        sensor.rows = std::size_t(taxels[0]);
        sensor.columns = std::size_t(taxels[1]);
        sensor.pitch_m = pitch_m;
    }
    if (array.size() != 2 || both) return {sensor};
    return as_array(sensor, std::size_t(array[0]), std::size_t(array[1]), pitch_m);
}

}  // namespace tactiled::sim
