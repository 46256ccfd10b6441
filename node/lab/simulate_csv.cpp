// A scene as signals.csv and truth.csv. Numbers are the shortest that read back to the same double. The files do not
// depend on the machine, the date or the block size, so the same scene gives the same bytes.
#include <fmt/format.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <iterator>
#include <numbers>
#include <stdexcept>

#include "decoupling/csv.hpp"
#include "node/lab/simulate.hpp"

namespace tactiled::ctl {
namespace {

using sim::Block;

class Output {
public:
    explicit Output(const std::string& path) : name_(path == "-" ? "standard output" : path) {
        if (path.empty()) return;
        file_.reset(path == "-" ? stdout : std::fopen(path.c_str(), "we"));
        if (file_ == nullptr) throw SetupError(why());
    }
    [[nodiscard]] bool is_open() const { return file_ != nullptr; }
    void put(const std::string& row) {
        if (std::fwrite(row.data(), 1, row.size(), file_.get()) != row.size()) throw std::runtime_error(why());
    }
    void close() {
        std::FILE* file = file_.release();
        if (file == nullptr) return;
        if ((file == stdout ? std::fflush(file) : std::fclose(file)) != 0) throw std::runtime_error(why());
    }

private:
    [[nodiscard]] std::string why() const { return fmt::format("{}: {}", name_, std::strerror(errno)); }
    std::string name_;
    File file_;
};

void add(std::string& row, double value) {
    row += ',';
    if (std::isfinite(value)) fmt::format_to(std::back_inserter(row), "{}", value);
}

bool arrives(const sim::Sensor& sensor, const Block& block, std::size_t n) {
    return (block.first + n) % sensor.every == 0 && !block.dropped[n];
}

void add_signals(std::string& row, const sim::Sensor& sensor, const Block& block, std::size_t n) {
    const bool here = arrives(sensor, block, n);
    for (std::size_t k = 0; k < sensor.n(); ++k)
        add(row, here && (block.missing[n] >> k & 1u) == 0 ? block.channel[k][n] : kNaN);
}

// + 0.0 avoids "-0" without a load.
void add_truth(std::string& row, const sim::Sensor& sensor, const Block& block, std::size_t n) {
    const bool here = arrives(sensor, block, n), touches = here && block.load[sim::kFz][n] < 0;
    for (std::size_t axis = 0; axis < sim::kAxes; ++axis) add(row, here ? block.load[axis][n] + 0.0 : kNaN);
    add(row, kNaN);  // mz: no motion exerts a moment that these sensors could measure
    add(row, touches ? block.x_m[n] + 0.0 : kNaN);
    add(row, touches ? block.y_m[n] + 0.0 : kNaN);
}

// The contact of a body with an array.
void add_contact(std::string& row, const sim::TaxelArray& array, const Block& block, std::size_t n) {
    const bool touches = block.load[sim::kFz][n] < 0;
    add(row, touches ? array.area_m2(n) : kNaN);
    add(row, touches ? array.axis_rad() * 180 / std::numbers::pi : kNaN);
}

std::string names_on(const sim::Choice& choice) {
    std::string names;
    for (const auto& d : choice.decisions)
        if (d.on) names += fmt::format("{}{}", names.empty() ? "" : " ", d.effect->name);
    return names.empty() ? "none" : names;
}

}  // namespace

void write_csv(const sim::Scene& scene, const std::string& effects, const std::string& signals, const std::string& truth) {
    sim::Simulation simulation(scene, effects);
    Output out(signals), true_out(truth);
    Progress progress("simulate");
    const bool plain = scene.sensors.size() == 1;
    std::string row = "t_s", true_row = "t_s";
    for (std::size_t i = 0; i < scene.sensors.size(); ++i) {
        const std::string prefix = plain ? "" : scene.sensors[i].name + ".";
        for (const auto& channel : scene.sensors[i].channels) row += fmt::format(",{}{}", prefix, channel);
        for (const char* column : {"fx_N", "fy_N", "fz_N", "mx_Nm", "my_Nm", "mz_Nm", "cop_x_m", "cop_y_m"})
            true_row += fmt::format(",{}{}", prefix, column);
        if (simulation.array(i) != nullptr) true_row += fmt::format(",{0}area_m2,{0}axis_deg", prefix);
        true_row += fmt::format(",{}effects", prefix);
    }
    row += '\n';
    true_row += '\n';
    std::vector<const Block*> block(scene.sensors.size());
    bool first = true;  // the header row, which also names the effects
    for (std::uint64_t done = 0; done < scene.samples; done += block[0]->n) {
        for (std::size_t i = 0; i < block.size(); ++i) block[i] = &simulation.advance(i);
        for (std::size_t n = 0; n < block[0]->n; ++n) {
            bool any = false;
            for (std::size_t i = 0; i < block.size(); ++i) any = any || arrives(scene.sensors[i], *block[i], n);
            if (!any) continue;
            // The nominal time of the sample, which a recorder would know. A device's own clock is not in the file.
            const std::string t_s = fmt::format("{}", double(block[0]->first + n) / scene.rate_Hz);
            row += t_s;
            true_row += t_s;
            for (std::size_t i = 0; i < block.size(); ++i) {
                if (out.is_open()) add_signals(row, scene.sensors[i], *block[i], n);
                if (!true_out.is_open()) continue;
                add_truth(true_row, scene.sensors[i], *block[i], n);
                if (const auto* array = simulation.array(i)) add_contact(true_row, *array, *block[i], n);
                true_row += ',';
                if (first) true_row += names_on(simulation.choice(i));
            }
            first = false;
            row += '\n';
            true_row += '\n';
        }
        if (out.is_open()) out.put(row);
        if (true_out.is_open()) true_out.put(true_row);
        row.clear();
        true_row.clear();
        progress.show(double(done) / double(scene.samples));
    }
    out.close();
    true_out.close();
}

}  // namespace tactiled::ctl
