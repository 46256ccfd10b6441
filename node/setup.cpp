#include "node/setup.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <boost/crc.hpp>
#include <cmath>
#include <limits>

#include "config/text_file.hpp"
#include "decoupling/method.hpp"
#include "decoupling/solve/domain.hpp"
#include "node/log.hpp"
#include "node/method_costs.hpp"
#include "node/objects.hpp"
#include "node/sensor_setup.hpp"

namespace tactiled {
namespace {

template <std::size_t N>
void put(char (&field)[N], const std::string& text) {
    text.copy(field, N - 1);
}

// Makes the driver of `link` and fills its entry in the directory.
void make_driver(LinkSettings& settings, Link& link, tactiled_link& directory) {
    put(directory.name, settings.name);
    put(directory.driver, settings.driver);
    if (settings.driver.empty()) return settings.options.accept_other_keys();  // the fault is reported already
    const DriverEntry* const entry = Drivers::find(settings.driver);
    if (entry == nullptr) {
        settings.options.problem("driver", fmt::format("driver = {} {}", in_quotes(settings.driver),
                                                       is_unknown(settings.driver, Drivers::names())));
        settings.options.accept_other_keys();
        return;
    }
    const bool simulated = settings.simulated.value_or(!entry->measures);
    if (!entry->measures && !simulated)
        settings.options.problem("simulated",
                                 fmt::format("driver \"{}\" measures nothing: simulated = true", settings.driver));
    directory.simulated = simulated ? 1 : 0;
    link.driver = entry->make(settings.options);
    if (link.driver == nullptr) return;
    const TaxelShape shape = link.driver->taxel_shape();
    link.taxels.make(shape, Link::kRingFrames);
    if (shape.size() != 0) directory.taxels.record_size = tactiled_taxels_size(std::uint32_t(shape.size()));
}

// Fills in the methods of method "auto".
void put_front(tactiled_sensor& entry, const AutoMethod& automatic, double budget_us) {
    put(entry.method, "auto");
    entry.budget_us = float(budget_us);
    entry.first_method = std::uint32_t(automatic.choice().first());
    std::vector<std::string_view> names;
    for (std::size_t i = 0; i < automatic.front().size(); ++i) {
        const FrontMethod& each = automatic.front()[i];
        names.push_back(each.cost.method);
        entry.method_us[i] = float(each.cost.us);
        entry.method_error[i] = float(each.inaccuracy);
    }
    put(entry.methods, fmt::format("{}", fmt::join(names, " ")));
}

// Fills in the array of a sensor, and returns the places of its taxels.
std::vector<float> put_array(tactiled_sensor& entry, const Patch& patch) {
    const TaxelPlaces& places = patch.places();
    entry.n_channels = 0;
    entry.n_taxels = patch.shape().taxels;
    entry.taxel_components = patch.components();
    entry.taxel_rows = places.rows;
    entry.taxel_columns = places.columns;
    std::vector<float> list;
    for (std::size_t i = 0; i < places.n; ++i) {
        list.insert(list.end(), {places.x[i], places.y[i], places.z[i]});
        list.insert(list.end(), places.normal[i].begin(), places.normal[i].end());
    }
    return list;
}

// The arrays of the link must be those of the calibration. A link without arrays can carry a small one in its channels.
// Returns the number of these.
std::size_t channels_of_array(SensorSettings& settings, const TaxelShape& of_link, const TaxelShape& of_calibration) {
    if (of_link.taxels == 0 && of_calibration.size() <= kMaxChannels) return of_calibration.size();
    const auto text = [](TaxelShape shape) {
        return shape.taxels == 0 ? std::string("no taxels")
                                 : fmt::format("{} taxels of {} values", shape.taxels, shape.values);
    };
    if (of_link != of_calibration)
        settings.options.problem("calibration",
                                 fmt::format("{} is for {}, link \"{}\" carries {} (its keys taxels and values)",
                                             settings.calibration, text(of_calibration), settings.link, text(of_link)));
    return 0;
}

tactiled_sensor directory_entry(const SensorSettings& settings, const Calibration& calibration, const Decoupler& decoupler) {
    tactiled_sensor entry{};
    put(entry.name, settings.name);
    put(entry.model, settings.model);
    put(entry.method, std::string(decoupler.method()));
    put(entry.serial, calibration.serial);
    put(entry.link, settings.link);
    entry.stale_ms = std::uint32_t(settings.stale_ms);
    entry.n_channels = std::uint32_t(calibration.channels.size());
    std::fill(std::begin(entry.full_scale), std::end(entry.full_scale), std::numeric_limits<float>::quiet_NaN());
    for (std::size_t i = 0; i < calibration.components.size(); ++i)
        for (std::size_t c = 0; c < kComponentNames.size(); ++c)
            if (calibration.components[i] == kComponentNames[c]) {
                entry.components |= 1u << c;
                if (i < calibration.full_scale.size()) entry.full_scale[c] = float(calibration.full_scale[i]);
            }
    const UndetectedDamage& damage = calibration.undetected_damage_of(settings.method);
    entry.undetected_mean = entry.undetected_worst = std::numeric_limits<float>::quiet_NaN();
    if (!damage.is_known()) return entry;
    const std::size_t kind = damage.worst_kind(), channel = damage.worst_channel(kind);
    entry.undetected_mean = float(damage.mean(kind));
    entry.undetected_worst = float(damage.share[kind][channel]);
    entry.undetected_channel = std::uint32_t(channel);
    entry.undetected_kind = std::uint32_t(kind);
    return entry;
}

// The text of a calibration and of those of its taxels.
std::string whole_text(const Calibration& calibration) {
    std::string text = calibration_text(calibration);
    for (const Calibration& taxel : calibration.taxels) text += calibration_text(taxel);
    return text;
}

// The id of the owner covers the channels and the calibration: a stored zero with another id is not used.
ZeroOwner zero_owner(const SensorSettings& settings, const Calibration& calibration, const Sensor::Setup& setup) {
    boost::crc_32_type id;
    const auto add = [&](const std::string& text) { id.process_bytes(text.c_str(), text.size() + 1); };
    add(whole_text(calibration));
    add(fmt::format("{:.17g} {} {}", settings.counts_per_unit, settings.link, settings.device));
    for (const auto& channel : settings.channels) add(channel);
    ZeroOwner owner{settings.name, calibration.serial, id.checksum(), {}, settings.zero_after != "forget"};
    if (setup.automatic == nullptr) owner.methods.emplace_back(setup.decoupler->method());
    for (std::size_t i = 0; setup.automatic != nullptr && i < setup.automatic->front().size(); ++i)
        owner.methods.emplace_back(setup.automatic->front()[i].cost.method);
    return owner;
}

// Adds the sensor, unless its files are wrong: the reason is then in `problems` and the node does not run.
void add_sensor(Node& node, SensorSettings& settings, Problems& problems, const std::string& costs_folder) {
    if (method_names(settings.model).empty()) {
        if (settings.model.empty()) return;  // reported already
        settings.options.problem(
            "model", fmt::format("model = \"{}\" {}", settings.model, is_unknown(settings.model, model_names())));
        return;
    }
    if (settings.calibration.empty()) return;
    Problems of_calibration;
    const Calibration calibration = load_calibration(settings.calibration, of_calibration);
    for (const auto& line : of_calibration.lines()) settings.options.problem("calibration", line);
    if (!of_calibration.empty()) return;
    if (calibration.model != settings.model) {
        settings.options.problem("calibration", fmt::format("{} is for model \"{}\", the sensor says \"{}\"",
                                                            settings.calibration, calibration.model, settings.model));
        return;
    }
    if (!settings.expect_serial.empty() && calibration.serial != settings.expect_serial) {
        settings.options.problem(
            "calibration",
            fmt::format("{} is of serial {}, expect_serial = {}: it belongs to another sensor", settings.calibration,
                        in_quotes(calibration.serial), in_quotes(settings.expect_serial)));
        return;
    }
    Sensor::Setup setup;
    DecouplerFault fault;
    if (settings.method == "auto") {
        const auto plain = make_decoupler(calibration, "", 0, fault);
        if (plain != nullptr && plain->patch() != nullptr)
            return settings.options.problem("method", "method = \"auto\": an array has one method; delete this key");
        const MethodCostFile file(costs_folder, node.config.node.name, settings.name, calibration);
        const std::vector<MethodCost> kept = file.load();
        std::vector<MethodCost> costs = kept;
        auto automatic = make_auto_method(calibration, settings.budget_us, costs, fault);
        if (automatic != nullptr && costs != kept) file.save(costs);
        setup.automatic = automatic.get();
        setup.decoupler = std::move(automatic);
    } else {
        setup.decoupler = make_decoupler(calibration, settings.method, 0, fault);
    }
    if (setup.decoupler == nullptr) settings.options.problem(fault.key, fault.text);
    Patch* const patch = setup.decoupler != nullptr ? setup.decoupler->patch() : nullptr;
    if (patch == nullptr) {
        put_channels(settings, calibration, setup);
    } else {
        patch->set_counts_per_unit(settings.counts_per_unit);
        if (!settings.channels.empty())
            settings.options.problem("channels", "an array has taxels, in the order of its link: delete this key");
    }
    if (setup.decoupler == nullptr || !problems.empty()) return;
    put_measuring(settings, calibration, setup);
    node.plan.sensors.push_back(directory_entry(settings, calibration, *setup.decoupler));
    tactiled_sensor& entry = node.plan.sensors.back();
    node.plan.places.push_back(patch != nullptr ? put_array(entry, *patch) : std::vector<float>{});
    node.zeros.push_back(zero_owner(settings, calibration, setup));
    setup.zero_id = node.zeros.back().id;
    if (setup.automatic != nullptr) put_front(entry, *setup.automatic, settings.budget_us);
    const Driver* driver = nullptr;
    for (auto& link : node.links) {
        if (link->name != settings.link) continue;
        link->bindings.push_back({std::uint16_t(settings.device), std::uint16_t(node.sensors.size())});
        link->age.add(std::uint16_t(settings.device), std::uint64_t(settings.stale_ms) * 1'000'000u);
        driver = link->driver.get();
        if (driver != nullptr && patch != nullptr)
            setup.frame_channels = channels_of_array(settings, driver->taxel_shape(), patch->shape());
    }
    setup.tuning = tuning_of(settings, calibration, setup.channel_of_frame, entry.full_scale, driver);
    node.sensors.emplace_back(std::move(setup));
    node.calibrations.push_back(whole_text(calibration));
    for (const Calibration& taxel : calibration.taxels) node.taxel_files.push_back(taxel.path);
}

// Refuses pairs without a common force component, which would always agree.
void check_pairs(Node& node) {
    constexpr std::uint32_t kForces = 7;
    for (std::size_t i = 0; i < node.config.sensors.size(); ++i) {
        SensorSettings& one = node.config.sensors[i];
        if (one.agrees_with.empty()) continue;
        const tactiled_sensor& other = node.plan.sensors[std::size_t(one.pair.other)];
        if ((node.plan.sensors[i].components & other.components & kForces) == 0)
            one.options.problem("agrees_with", fmt::format("agrees_with = \"{}\" sees no component of the force that this "
                                                           "sensor sees, too",
                                                           one.agrees_with));
    }
}

// Returns the estimator's setup from [grasp]; index and full scale of each jaw's sensor are those of the directory.
std::optional<Grasping::Setup> grasp_setup(Config& config, const SegmentPlan& plan, Problems& problems) {
    if (!config.grasp) return std::nullopt;
    const GraspSettings& settings = *config.grasp;
    Grasping::Setup setup;
    for (const auto& jaw : settings.jaws)
        for (std::size_t i = 0; i < config.sensors.size(); ++i) {
            SensorSettings& sensor = config.sensors[i];
            if (sensor.name != jaw.sensor) continue;
            grasp::JawSetup entry;
            entry.sensor = std::uint32_t(i);
            entry.S_from_G = jaw.S_from_G;
            entry.share = jaw.share;
            entry.contact_on_N = sensor.contact_on_N;
            entry.contact_off_N = sensor.contact_off_N;
            for (std::size_t c = 0; c < 3; ++c) {
                const float full_scale_N = plan.sensors[i].full_scale[c];
                if (std::isfinite(full_scale_N)) entry.full_scale_N[c] = double(full_scale_N);
            }
            if (entry.full_scale_N[2] > 0 && entry.contact_on_N >= entry.full_scale_N[2])
                sensor.options.problem(
                    "contact_on_N",
                    fmt::format("contact_on_N = {:g} is not below the full scale of its calibration, a press "
                                "of {:g} N: the jaw would never touch",
                                entry.contact_on_N, entry.full_scale_N[2]));
            const MethodEntry* const method = find_method(sensor.model, plan.sensors[i].method);  // nullptr for "auto"
            entry.errs_by_gain = method != nullptr && method->errs_by_gain;
            setup.estimator.jaws.push_back(entry);
        }
    setup.estimator.jaws_of_gripper = unsigned(settings.jaws_of_gripper);
    setup.estimator.gravity_G = settings.gravity_G_m_s2;
    setup.estimator.friction = settings.friction;
    setup.estimator.share_sd = settings.share_sd;
    setup.estimator.margin = settings.margin;
    setup.estimator.weigh_window_ms = settings.weigh_window_ms;
    setup.estimator.lift_acceleration_m_s2 = settings.lift_acceleration_m_s2;
    setup.estimator.lift_accelerates_ms = settings.lift_accelerates_ms;
    setup.settable = {settings.slip_sensitivity, settings.weigh_window_ms};
    setup.objects = load_objects(settings.objects, problems);
    if (std::any_of(setup.objects.begin(), setup.objects.end(), [](const TaughtObject& o) { return o.scaled; }))
        log_line(LogLevel::warning,
                 "{}: objects that were taught after a known weight had set the scale are recognised only once a known "
                 "weight is shown again (tactilectl weigh known)",
                 settings.objects);
    return setup;
}

std::optional<tool::Setup> tool_setup(const Config& config) {
    if (!config.tool) return std::nullopt;
    const ToolSettings& settings = *config.tool;
    const auto metres = [](const std::array<double, 3>& mm) { return tool::Vector{mm[0] / 1e3, mm[1] / 1e3, mm[2] / 1e3}; };
    tool::Setup setup;
    setup.gravity_G_m_s2 = settings.gravity_G_m_s2;
    setup.acceleration_m_s2 = settings.acceleration_m_s2;
    setup.accelerates_ms = settings.accelerates_ms;
    for (const ToolSensorSettings& one : settings.sensors)
        for (std::size_t i = 0; i < config.sensors.size(); ++i)
            if (config.sensors[i].name == one.sensor)
                setup.sensors.push_back({std::uint32_t(i), one.S_from_G, metres(one.position_G_mm), one.mass_kg,
                                         one.mass_sd_kg, metres(one.centre_G_mm), one.centre_sd_mm / 1e3, one.zero_S_N,
                                         one.zero_S_Nm, one.zero_sd_N, one.zero_sd_Nm});
    return setup;
}

// Returns CAL_ID: one number that changes when the configuration or any calibration changes.
std::uint16_t identity_of(const Node& node, Problems& problems) {
    constexpr std::size_t kMaxBytes = std::size_t{16} << 20;  // the same limit as for a calibration
    boost::crc_optimal<16, 0x1021, 0xFFFF, 0, false, false> crc;
    const auto add_file = [&](const std::string& path) {
        const auto bytes = read_text_file(path, kMaxBytes, problems);
        if (bytes) crc.process_bytes(bytes->data(), bytes->size());
    };
    add_file(node.config.path);
    for (const auto& sensor : node.config.sensors) add_file(sensor.calibration);
    for (const auto& file : node.taxel_files) add_file(file);
    return crc.checksum();
}

}  // namespace

Node load_node(const std::string& config_path, Problems& problems, const std::string& costs_folder) {
    Node node{.config = load_config(config_path, problems),
              .calibrations = {},
              .taxel_files = {},
              .zeros = {},
              .links = {},
              .sensors = {},
              .grasp = {},
              .tool = {},
              .plan = {}};
    Config& config = node.config;
    for (std::size_t i = 0; i < config.links.size(); ++i) {
        auto link = std::make_unique<Link>();
        link->name = config.links[i].name;
        link->index = std::uint32_t(i);
        tactiled_link entry{};
        make_driver(config.links[i], *link, entry);
        node.simulated |= entry.simulated != 0;
        node.plan.links.push_back(entry);
        node.links.push_back(std::move(link));
    }
    for (auto& settings : config.sensors) add_sensor(node, settings, problems, costs_folder);
    config.root.finish();
    if (!problems.empty()) return node;
    check_pairs(node);
    if (!problems.empty()) return node;

    node.grasp = grasp_setup(config, node.plan, problems);
    node.tool = tool_setup(config);
    node.plan.tool = node.tool.has_value();
    node.plan.name = config.node.name;
    node.plan.version = TACTILED_VERSION;
    node.plan.control = config.node.control;
    node.plan.group = config.shm.group;
    node.plan.watchdog_ms = std::uint32_t(config.node.watchdog_ms);
    node.plan.history = std::uint32_t(config.shm.history);
    node.plan.array_history = std::uint32_t(config.shm.array_history);
    node.plan.calibration_id = identity_of(node, problems);
    return node;
}

}  // namespace tactiled
