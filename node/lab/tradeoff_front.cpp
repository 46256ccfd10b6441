#include "node/lab/tradeoff.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace tactiled::ctl {
namespace {

constexpr double kWorth = 0.95;  // a method that improves the error by less than 5 % is not listed

}  // namespace

std::vector<std::size_t> front(const std::vector<Offer>& offers) {
    std::vector<std::size_t> order(offers.size()), best;
    std::iota(order.begin(), order.end(), 0u);
    std::erase_if(
        order, [&](std::size_t i) { return !std::isfinite(offers[i].time_us) || !std::isfinite(offers[i].error_percent); });
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
        return std::pair(offers[a].time_us, offers[a].error_percent) < std::pair(offers[b].time_us, offers[b].error_percent);
    });
    double min = std::numeric_limits<double>::infinity();
    for (const std::size_t i : order)
        if (offers[i].error_percent < min) {
            min = offers[i].error_percent;
            best.push_back(i);
        }
    return best;
}

std::string front_sentence(const std::string& model, const std::vector<Offer>& offers) {
    std::string text = model + ":";
    std::size_t named = 0;
    double last_percent = std::numeric_limits<double>::infinity();
    for (const std::size_t i : front(offers)) {
        const Offer& offer = offers[i];
        if (offer.error_percent > kWorth * last_percent) continue;
        last_percent = offer.error_percent;
        const std::string bad = offer.bad_percent > 0 ? fmt::format(", no value in {:.2g} %", offer.bad_percent) : "";
        text += named++ == 0
                    ? fmt::format(" {} from {:.2g} us a sample ({:.2g} % rms of full scale{})", offer.name, offer.time_us,
                                  offer.error_percent, bad)
                    : fmt::format("; {} from {:.2g} us ({:.2g} %{})", offer.name, offer.time_us, offer.error_percent, bad);
    }
    if (named == 0) return text + " nothing to choose from.";
    return text + (named < offers.size() ? "; no other is worth its time." : ".");
}

}  // namespace tactiled::ctl
