#include "drivers/sim/scene.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace tactiled::sim {
namespace {

constexpr double kMaxSamples = 1e10;

Body read_body(Options table, double ambient_C) {
    Body body;
    using Shape = Body::Shape;
    const std::pair<std::string, Shape> shapes[] = {{"flat", Shape::flat},         {"sphere", Shape::sphere},
                                                    {"edge", Shape::edge},         {"textured", Shape::textured},
                                                    {"cylinder", Shape::cylinder}, {"fingers", Shape::fingers}};
    std::vector<std::string> names;
    for (const auto& shape : shapes) names.push_back(shape.first);
    const std::string name = table.one_of("shape", names, "flat");
    for (const auto& shape : shapes)
        if (shape.first == name) body.shape = shape.second;
    body.radius_m = table.number("radius_m", {1e-6, 1}, body.radius_m);
    body.length_m = table.number("length_m", {1e-6, 1}, body.length_m);
    body.apart_m = table.number("apart_m", {0, 1}, body.apart_m);
    body.turn_rad = table.number("turn_deg", {-360, 360}, 0) * std::numbers::pi / 180;
    body.stiffness_Pa = table.number("stiffness_Pa", {1e2, 1e13}, body.stiffness_Pa);
    body.friction = table.number("friction", {0, 10}, body.friction);
    body.kinetic_friction = table.number("kinetic_friction", {0, 10}, std::min(body.kinetic_friction, body.friction));
    body.mass_kg = table.number("mass_kg", {0, 1000}, 0);
    body.temperature_K = table.number("temperature_C", {-50, 200}, ambient_C) - ambient_C;
    body.texture_pitch_m = table.number("texture_pitch_m", {1e-6, 0.1}, body.texture_pitch_m);
    body.texture_height_m = table.number("texture_height_m", {0, 0.01}, body.shape == Body::Shape::textured ? 20e-6 : 0);
    body.adhesion_J_m2 = table.number("adhesion_J_m2", {0, 100}, 0);
    if (body.kinetic_friction > body.friction) table.problem("kinetic_friction", "is more than friction");
    return body;
}

// A link carries arrays of one shape, and a body has a law of contact on arrays or on single sensors.
void check_arrays(Options& options, const Scene& scene) {
    const Sensor* first = nullptr;
    bool single = false;
    for (const Sensor& sensor : scene.sensors) {
        if (!sensor.is_array()) single = true;
        if (!sensor.is_array()) continue;
        if (first == nullptr) first = &sensor;
        if (sensor.taxels() != first->taxels() || sensor.n() != first->n())
            options.problem("sensor", fmt::format("\"{}\" has another number of taxels or values than \"{}\": put it into a "
                                                  "scene of its own",
                                                  sensor.name, first->name));
    }
    using Shape = Body::Shape;
    if (single && (scene.body.shape == Shape::cylinder || scene.body.shape == Shape::fingers))
        options.problem("body", "a cylinder or fingers need sensors with taxels = [rows, columns]");
    if (first != nullptr && (scene.body.shape == Shape::textured || scene.body.adhesion_J_m2 > 0))
        options.problem("body",
                        fmt::format("texture and adhesion do not occur on an array of taxels, as \"{}\" is", first->name));
}

// [effects.NAME]: each parameter that the scene sets; the others keep their defaults.
std::vector<std::vector<double>> read_parameters(Options table) {
    std::vector<std::vector<double>> all;
    std::vector<std::string> names;
    for (const EffectEntry* effect : chain()) {
        names.emplace_back(effect->name);
        Options keys = table.table(effect->name);
        auto& values = all.emplace_back();
        for (const Parameter& p : effect->parameters) values.push_back(keys.number(p.name, {p.min, p.max}, p.usual));
    }
    return all;
}

// Reads the expectations that tests/scenes checks and that describe the scene to a reader; the simulator does not use
// them.
void read_expectations(Options& scene) {
    for (Options& e : scene.tables("expect", 64)) {
        e.text("sensor");
        e.text("calibration");
        e.text("method", "");
        e.numbers("within_N", {0, 1e4}, {3, 3});
        for (const char* key : {"gain_within", "leak_within", "late_within_s", "spread_within"})
            e.numbers(key, {0, 1e4}, {3, 3});
        e.number("from_s", {0, 1e7}, 0);
        e.number("to_s", {0, 1e7}, 1e7);
        e.number("share", {0, 1}, 0.99);
        e.one_of("quality", {"good", "uncertain", "any"}, "any");
        e.flag("press_only", false);
        e.flag("tare", true);
        e.numbers("reads_N", {-1e4, 1e4}, {3, 3});
    }
    Options calibrate = scene.table("calibrate");
    calibrate.texts("components", {1, 6});
    calibrate.texts("channels", {1, 32});
    calibrate.texts("set", {1, 64});
    calibrate.text("model", "");
    calibrate.number("settle_s", {0, 1e3}, 0.05);
    calibrate.number("from_s", {0, 1e7}, 0);
    calibrate.text("influence", "");
    calibrate.number("dummy_difference_K", {0, 100}, 0);
    calibrate.number("dummy_at_C", {-273.15, 1000}, 23);
}

}  // namespace

Scene read_scene(Options options, Problems& problems) {
    Scene scene;
    scene.file = options.file();
    options.integer("format", {1, 1});
    scene.title = options.text("title");
    scene.seed = std::uint64_t(options.integer("seed", {0, 9e15}, 1));
    scene.rate_Hz = options.number("rate_Hz", {0.1, 1e5}, 1000);
    scene.wanted_accuracy_N = options.number("wanted_accuracy_N", {0, 1e4}, 0);
    const double ambient_C = options.table("surroundings").number("temperature_C", {-50, 150}, 23);
    scene.body = read_body(options.table("body"), ambient_C);
    for (Options& table : options.tables("sensor", 64))
        for (Sensor& sensor : read_sensor(table)) {
            if (std::ranges::find(scene.sensors, sensor.name, &Sensor::name) != scene.sensors.end())
                table.problem("name", fmt::format("there are two sensors \"{}\"", sensor.name));
            sensor.device = std::uint16_t(scene.sensors.size());
            scene.sensors.push_back(std::move(sensor));
        }
    check_arrays(options, scene);
    if (scene.sensors.empty()) options.problem("sensor", "a scene has at least one [[sensor]]");
    scene.motion = read_motion(options, scene.body, scene.rate_Hz);
    scene.parameters = read_parameters(options.table("effects"));
    read_expectations(options);
    const double length_s = options.number("length_s", {0, 1e9}, scene.motion.length_s());
    if (length_s * scene.rate_Hz > kMaxSamples) options.problem("length_s", "more than 1e10 samples");
    scene.samples = std::uint64_t(std::llround(length_s * scene.rate_Hz));
    options.finish();
    problems.throw_if_any();
    return scene;
}

Scene read_scene(const std::string& path) {
    Problems problems;
    return read_scene(Options::parse_file(path, problems), problems);
}

std::vector<double> Scene::delay_s(const Sensor& sensor) const {
    const Extent extent = motion.extent(sensor);
    std::vector<double> sum(sensor.n());
    for (std::size_t i = 0; i < chain().size(); ++i)
        if (const EffectEntry& entry = *chain()[i];
            entry.delay_s != nullptr && (entry.models & 1u << unsigned(sensor.model)) != 0)
            for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += entry.delay_s(setting(i, sensor, extent), k);
    return sum;
}

Setting Scene::setting(std::size_t effect, const Sensor& sensor, const Extent& extent) const {
    const EffectEntry& entry = *chain()[effect];
    return {sensor,
            body,
            extent,
            rate_Hz,
            samples,
            Stream(seed, fmt::format("{}/{}", sensor.name, entry.name)),
            Stream(sensor.serial, entry.name),
            parameters[effect],
            this};
}

}  // namespace tactiled::sim
