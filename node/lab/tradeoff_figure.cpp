// The methods as points of error over time, with a symbol and colour for each model; the front of each model is
// filled and joined.
#include <algorithm>
#include <array>
#include <cmath>

#include "node/lab/chart/figure.hpp"
#include "node/lab/tradeoff.hpp"

namespace tactiled::ctl {

std::string tradeoff_svg(const std::vector<Result>& results) {
    constexpr std::array kSymbols{Symbol::circle, Symbol::square, Symbol::triangle, Symbol::diamond, Symbol::cross};
    Figure figure{.title = "What accuracy costs in time (filled: nothing is faster and as accurate)",
                  .x = {"time a sample, median, microseconds", true},
                  .y = {"error of force, rms, % of full scale", true}};
    for (std::size_t r = 0; r < results.size(); ++r) {
        const Result& result = results[r];
        Figure::Series best{result.contest->model, kSymbols[r % kSymbols.size()], Stroke::solid, {}, int(r)};
        Figure::Series others{.name = "", .symbol = best.symbol, .colour = best.colour, .hollow = true};
        for (std::size_t i = 0; i < result.measures.size(); ++i) {
            const Measure& all = result.measures[i].back();
            // A method that is too fast for the clock is drawn at its resolution.
            (all.on_front ? best : others)
                .points.push_back(
                    {std::max(all.p50_ns, 1.0) / 1e3, all.judged.force_rms_percent, result.contest->candidates[i].name});
        }
        std::sort(best.points.begin(), best.points.end(), [](const auto& a, const auto& b) { return a.x < b.x; });
        figure.series.push_back(std::move(best));
        figure.series.push_back(std::move(others));
    }
    return figure_svg(figure);
}

}  // namespace tactiled::ctl
