// The centre of pressure against the bound of Cramer and Rao: presses at random places on simulated sensors, and the
// covariance that no unbiased estimator of force and place can fall below, (J' W J)^-1, from the Jacobian of the forward
// model and its noise. Fixed seeds: the same table everywhere.
//
//   place_bound                        5 s
//
// Each line: rms of error / bound over the presses above 10 sd of fz, the part of the errors within one stated sd and
// beyond five, and the presses above and below 5 sd of fz that have a place.
#include <fmt/format.h>

#include <Eigen/Dense>
#include <cmath>
#include <functional>
#include <random>
#include <string>

#include "decoupling/fit/fit.hpp"
#include "decoupling/place.hpp"
#include "decoupling/table/influence_map.hpp"
#include "pressed_array.hpp"
#include "unit/decoupling/map_contacts.hpp"

namespace {

using namespace tactiled;
using Random = std::mt19937_64;

double between(Random& random, double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); }

// Returns the least sd of the last two parameters, x and y, for a Jacobian whose rows are divided by their sd.
std::array<double, 2> bound_of(const Eigen::MatrixXd& weighted) {
    const Eigen::MatrixXd covariance = (weighted.transpose() * weighted).inverse();
    const Eigen::Index n = covariance.rows();
    return {std::sqrt(covariance(n - 2, n - 2)), std::sqrt(covariance(n - 1, n - 1))};
}

// Errors of places, over all presses of a sensor.
struct Judged {
    std::string name;
    double squares = 0, bound_squares = 0, ratios = 0;
    int n = 0, within = 0, beyond = 0, above = 0, lacking = 0, below = 0, places_below = 0;

    void add(const PressPlace& place, const std::array<double, 2>& truth, const std::array<double, 2>& bound, double in_sd) {
        for (std::size_t i = 0; i < 2; ++i) {
            const bool has_place = std::isfinite(place.cop_S_m[i]);
            if (!(in_sd > kPlace_sd)) {
                ++below;
                places_below += has_place ? 1 : 0;
                continue;
            }
            ++above;
            lacking += has_place ? 0 : 1;
            if (!has_place || !(in_sd > 10)) continue;
            const double error = place.cop_S_m[i] - truth[i];
            squares += error * error;
            bound_squares += bound[i] * bound[i];
            ratios += error * error / (bound[i] * bound[i]);
            ++n;
            within += std::abs(error) <= place.sd_m[i] ? 1 : 0;
            beyond += !(std::abs(error) <= 5 * place.sd_m[i]) ? 1 : 0;
        }
    }
    void print() const {
        fmt::print(
            "{}: {:.3f} of the bound ({:.3f} pooled), within 1 sd {:.1f} %, beyond 5 sd {:.2f} %, {} places; above 5 sd "
            "{:.2f} % of {} lack a place, below {:.2f} % of {} have one\n",
            name, std::sqrt(ratios / n), std::sqrt(squares / bound_squares), 100. * within / n, 100. * beyond / n, n,
            100. * lacking / std::max(above, 1), above, 100. * places_below / std::max(below, 1), below);
    }
};

// ---- a pad of linear channels, calibrated with generic/matrix ------------------------------------------------------------

struct Load {
    double fx, fy, fz, x, y;
    [[nodiscard]] Eigen::Matrix<double, 5, 1> wrench() const {
        return (Eigen::Matrix<double, 5, 1>() << fx, fy, fz, y * fz, -x * fz).finished();
    }
    // Derivatives of the wrench by fx fy fz x y.
    [[nodiscard]] Eigen::Matrix<double, 5, 5> slope() const {
        Eigen::Matrix<double, 5, 5> slope = Eigen::Matrix<double, 5, 5>::Zero();
        slope(0, 0) = slope(1, 1) = slope(2, 2) = 1;
        slope(3, 2) = y, slope(3, 4) = fz;
        slope(4, 2) = -x, slope(4, 3) = -fz;
        return slope;
    }
};

constexpr double kNoise = 0.01;  // sd of each channel, which reads about 1 for 1 N or 10 mN m
constexpr double kReach_m = 4e-3;

Load random_load(Random& random, double press_N) {
    return {between(random, -1, 1) * press_N / 4, between(random, -1, 1) * press_N / 4, -press_N,
            between(random, -kReach_m, kReach_m), between(random, -kReach_m, kReach_m)};
}

void judge_pad(std::size_t channels) {
    Random random(channels);
    std::normal_distribution<double> one(0, 1);
    Eigen::MatrixXd gain(channels, 5);
    for (Eigen::Index k = 0; k < gain.size(); ++k) gain(k) = one(random);
    gain.rightCols(2) *= 100;
    const auto read = [&](const Load& load) {
        std::vector<double> channel(channels);
        const Eigen::VectorXd clean = gain * load.wrench();
        for (std::size_t k = 0; k < channels; ++k) channel[k] = clean[Eigen::Index(k)] + kNoise * one(random);
        return channel;
    };
    Labelled labelled;
    labelled.name = "pad";
    for (std::size_t k = 0; k < channels; ++k) labelled.channels.push_back(fmt::format("C{}", k + 1));
    for (int i = 0; i < 4000; ++i) {
        const Load load = random_load(random, i % 10 == 0 ? 0 : between(random, 0.05, 5));
        const auto w = load.wrench();
        labelled.rows.push_back({i + 2, read(load), {w[0], w[1], w[2], w[3], w[4], kNaN}, 0, std::uint64_t(i) * 10'000'000});
    }
    FitRequest request;
    request.model = "generic", request.method = "matrix";
    request.channel_unit = "V", request.date = "2026-03-01";
    const Calibration calibration = fit(labelled, request).calibration;
    const auto decoupler = make_decoupler(calibration);
    Judged judged{fmt::format("generic/matrix, {} channels", channels)};
    for (int i = 0; i < 20000; ++i) {
        const Load load = random_load(random, std::exp(between(random, std::log(0.02), std::log(5))));
        const std::vector<double> channel = read(load);
        const Estimate e = decoupler->decouple({.channel = channel});
        judged.add(place_of(e.wrench_S, e.sd, covariance_of(e.correlation, e.sd)), {load.x, load.y},
                   bound_of(gain * load.slope() / kNoise), -e.wrench_S[2] / e.sd[2]);
    }
    judged.print();
}

// ---- the table sensor's plate, by finite elements ------------------------------------------------------------------------

// The noise is that of the method's model: of each gauge, and a gain error of 1 % of their rms.
void judge_plate() {
    Calibration calibration = map_calibration();
    calibration.sd = {1e-4, 1e-4, 1e-4, 1e-7, 1e-7};  // no error of the plate
    std::string fault;
    const auto influence = influence_of(calibration, fault);
    const auto map = make_decoupler(calibration);
    Random random(3);
    std::normal_distribution<double> one(0, 1);
    Judged judged{"table/map"};
    for (int i = 0; i < 6000; ++i) {
        const Contact truth = random_contact(random, 0.7e-3, std::exp(between(random, std::log(0.01), 0)), 0);
        std::vector<double> reading = strains(truth);
        const double sd = std::hypot(1e-6, 0.01 * rms(reading));
        for (double& r : reading) r += sd * one(random);
        const Eigen::Vector3d force(truth.force_N[0], truth.force_N[1], truth.force_N[2]);
        InfluenceMap::At at;
        influence->at(truth.x_m, truth.y_m, at);
        Eigen::Matrix<double, 8, 5> j;
        j << at.value, at.dx * force, at.dy * force;
        (void)map->decouple({.channel = {}});  // another device: the point is not followed
        const Estimate e = map->decouple({.channel = reading});
        if (e.quality() != TACTILED_GOOD) continue;
        const Eigen::MatrixXd inverse = (j.transpose() * j).inverse();
        judged.add({e.cop_S_m, e.cop_sd_m}, {truth.x_m, truth.y_m}, bound_of(j / sd),
                   -force.z() / (sd * std::sqrt(inverse(2, 2))));
    }
    judged.print();
}

// ---- an array ------------------------------------------------------------------------------------------------------------

// The bound knows shape and size of the body, which the array does not; for a body within one taxel there is no bound. The
// sd of fz is that of all taxels, and the limit that of the contact's: weaker presses have a place, too.
void judge_array(const std::string& name, const std::function<pressed::Body(Random&)>& make) {
    const pressed::Array array;
    const auto patch = make_decoupler(pressed::calibration_of(array));
    Random random(11);
    std::normal_distribution<double> one(0, 1);
    Judged judged{name};
    constexpr double kStep_m = 50e-6;
    const std::size_t n = array.taxels();
    for (int i = 0; i < 2000; ++i) {
        const pressed::Body body = make(random);
        std::vector<double> gain(n);
        for (double& g : gain) g = 1 + array.gain_sd * one(random);
        std::vector<float> raw(n, 0);
        pressed::press(array, body, gain, raw);
        for (float& value : raw) value += float(array.noise_N * array.counts_per_N * one(random));
        Reading reading;
        reading.taxels = {{std::uint16_t(n), 1}, raw};
        const Estimate e = patch->decouple(reading);
        const auto moved = [&](double dx, double dy) {
            pressed::Body other = body;
            other.x += dx, other.y += dy;
            return pressed::parts_of(array, other);
        };
        const std::vector<double> part = moved(0, 0), right = moved(kStep_m, 0), left = moved(-kStep_m, 0),
                                  up = moved(0, kStep_m), down = moved(0, -kStep_m);
        Eigen::MatrixXd j(n, 3);
        for (std::size_t k = 0; k < n; ++k) {
            const auto row = Eigen::Index(k);
            const double per_m = body.force / (2 * kStep_m);
            j.row(row) << part[k], (right[k] - left[k]) * per_m, (up[k] - down[k]) * per_m;
            j.row(row) /= std::hypot(array.noise_N, array.gain_sd * part[k] * body.force);
        }
        judged.add({e.cop_S_m, e.cop_sd_m}, {body.x, body.y}, bound_of(j), body.force / e.sd[2]);
    }
    judged.print();
}

pressed::Body ball(Random& random, double smallest_m, double largest_m) {
    const double a = between(random, smallest_m, largest_m), reach = 16e-3 - a - 2e-3;
    return {pressed::Kind::ball,
            between(random, -reach, reach),
            between(random, -reach, reach),
            std::exp(between(random, std::log(0.1), std::log(10))),
            a,
            a,
            0};
}

}  // namespace

int main() {
    judge_pad(5);
    judge_pad(8);
    judge_plate();
    judge_array("array, balls of 3 to 7 mm", [](Random& random) { return ball(random, 3e-3, 7e-3); });
}
