// tactilectl tradeoff: what accuracy costs in time, measured on the machine that it runs on.
#include "node/ctl/tradeoff.hpp"

#include <memory>

#include "node/ctl/verb.hpp"

namespace tactiled::ctl {
namespace {

struct Wish {
    std::string cost;
    TradeoffOutput output;
};

int tradeoff(const Wish& wish) { return tradeoff_costs(wish.cost, wish.output); }

}  // namespace

void add_tradeoff(CLI::App& app, Run& run) {
    auto wish = std::make_shared<Wish>();
    auto* verb = app.add_subcommand("tradeoff", "Measures what accuracy costs in time, on this machine");
    verb->add_option(
        "--cost", wish->cost,
        "instead of the methods: what one part costs against another way of doing it; list, all (each figure to "
        "its place in --folder) or a name");
    verb->add_option("--folder", wish->output.folder, "with --cost: the project's folder, for config/")
        ->capture_default_str();
    verb->add_option(
        "--influence", wish->output.influence,
        "with --cost map, solver, batch: a calibration with the plate's influence map, if not the one in config/");
    verb->add_option("--csv", wish->output.csv, "write the table as CSV");
    verb->add_option("--svg", wish->output.svg, "write the figure as SVG");
    verb->add_option("--samples", wish->output.samples, "to time, of each thing that is compared");
    verb->add_flag("--json", wish->output.json, "print the table as JSON");
    verb->callback([wish, &run] { run = [wish] { return tradeoff(*wish); }; });
}

}  // namespace tactiled::ctl
