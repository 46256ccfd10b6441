// orders [TABLES.md]      runs the litmus tests, explores every scenario, and weakens each memory order of the product, one
// at a
//                         time. Exit status 1: an outcome is wrong, a property is violated, a weaker order is not found, or
//                         the page has other tables.
// orders --litmus, --scenarios [NAME], --plants [NAME]   a part
#include <cstdio>
#include <ctime>
#include <fstream>
#include <iostream>
#include <iterator>
#include <regex>
#include <set>
#include <string_view>

#include "instead.hpp"
#include "scenarios.hpp"

namespace orders {
namespace {

struct Explored {
    Scenario scenario;
    std::uint64_t executions;
    Sites sites;
};

double processor_s() { return double(std::clock()) / CLOCKS_PER_SEC; }

std::vector<Explored> all_scenarios(std::string_view part) {
    std::vector<Explored> all;
    for (auto* const some : {ring_scenarios, runner_scenarios, handover_scenarios, slot_scenarios, segment_scenarios})
        for (auto& scenario : some())
            if (scenario.name.find(part) != std::string::npos) all.push_back({std::move(scenario), 0, {}});
    return all;
}

// Fills in the sites. False where a property is violated.
bool explore(std::vector<Explored>& all, std::string& page) {
    bool right = true;
    page += "| scenario | bounds | executions | repetitions left out |\n|---|---|---|---|\n";
    for (auto& [scenario, executions, found] : all) {
        const double begin_s = processor_s();
        forget_sites();
        const Outcome outcome = explorer().explore(scenario);
        executions = outcome.executions + outcome.pruned;
        found = sites();
        page += fmt::format("| {} | {} | {} | {} |\n", scenario.name, scenario.bounds, outcome.executions, outcome.pruned);
        std::cerr << fmt::format("{}: {} executions, {:.2f} s\n", scenario.name, executions, processor_s() - begin_s);
        if (outcome.violation.empty()) continue;
        right = false;
        std::cerr << fmt::format("{}: {}\n{}", scenario.name, outcome.violation, outcome.story);
    }
    return right;
}

// The first scenario that shows the plant, those with few executions first.
bool is_found(const std::vector<Explored>& all, const Plant& plant, std::string& row) {
    std::vector<const Explored*> candidates;
    for (const auto& explored : all)
        if (explored.sites.contains(plant.site)) candidates.push_back(&explored);
    std::stable_sort(candidates.begin(), candidates.end(), [](auto* a, auto* b) { return a->executions < b->executions; });
    std::uint64_t executions = 0;
    for (const auto* explored : candidates) {
        const Outcome outcome = explorer().explore(explored->scenario, &plant);
        executions += outcome.executions + outcome.pruned;
        if (outcome.violation.empty()) continue;
        row += fmt::format("{}: {} | {} |\n", explored->scenario.name, outcome.violation, executions);
        return true;
    }
    row += fmt::format("NOT FOUND | {} |\n", executions);
    return false;
}

// False where a plant in the product is not found.
bool find_plants(const std::vector<Explored>& all, std::string_view part, std::string& page) {
    Sites places;
    for (const auto& explored : all) places.insert(explored.sites.begin(), explored.sites.end());
    bool right = true;
    page += "| file | operation | order | weakened to | found in, by | executions |\n|---|---|---|---|---|---|\n";
    for (const auto& [site, use] : places) {
        if (!is_product(site) || (site.file + text_of(site)).find(part) == std::string::npos) continue;
        for (const Plant& plant : plants_of(site, use.first, use.second)) {
            const double begin_s = processor_s();
            const bool call = plant.use == Use::call;
            std::string row = fmt::format("| {} | `{}` | {} | {} | ", site.file, text_of(site),
                                          call ? "system call" : name_of(plant.from), call ? "left out" : name_of(plant.to));
            right = is_found(all, plant, row) && right;
            std::cerr << fmt::format("{}:{}: {:.2f} s: {}", site.file, site.line, processor_s() - begin_s, row);
            page += row;
        }
    }
    return right;
}

// Orders in the text of the explored classes that no scenario has performed: they would not be weakened.
bool all_are_reached(const std::vector<Explored>& all) {
    std::set<std::string> files;
    std::set<std::pair<std::string, unsigned>> lines;
    for (const auto& explored : all)
        for (const auto& [site, use] : explored.sites)
            for (const unsigned line : {site.line - 1, site.line, site.line + 1}) lines.emplace(site.file, line);
    for (const auto& [file, line] : lines) files.insert(file);
    bool right = true;
    for (const auto& file : files)
        for (unsigned line = 1, end = lines_of(file); line <= end; ++line) {
            const std::string text = text_of({file, line});
            const bool has_order = std::regex_search(text, std::regex("[^_](acquire|release|acq_rel|seq_cst)[,)]"));
            if (!is_product({file}) || !has_order || lines.contains({file, line})) continue;
            std::cerr << fmt::format("{}:{}: no scenario performs this: {}\n", file, line, text);
            right = false;
        }
    return right;
}

// A release that nothing needs is not found: otherwise the search for plants would show nothing.
bool control_is_not_found() {
    Scenario scenario;
    scenario.name = "control";
    scenario.build = [](Execution& run) {
        auto word = run.make<Atomic<int>>(0);
        run.thread([word] { word->store(1, std::memory_order_release); });
        run.thread([word] { (void)word->load(std::memory_order_acquire); });
    };
    std::vector<Explored> control{{scenario, 0, {}}};
    std::string page;
    if (!explore(control, page) || control[0].sites.size() != 2) return false;
    for (const auto& [site, use] : control[0].sites)
        for (const Plant& plant : plants_of(site, use.first, use.second))
            if (is_found(control, plant, page)) return false;
    return true;
}

int run(const std::vector<std::string_view>& arguments) {
    const std::string_view first = arguments.empty() ? "" : arguments[0], part = arguments.size() < 2 ? "" : arguments[1];
    const bool everything = !first.starts_with("--");
    std::string tests, explored, plants;
    bool right = true;
    if (everything || first == "--litmus") right = litmus(tests) && right;
    if (first != "--litmus") {
        auto all = all_scenarios(first == "--scenarios" ? part : "");
        right = explore(all, explored) && right;
        if (everything) right = all_are_reached(all) && control_is_not_found() && right;
        if (everything || first == "--plants") right = find_plants(all, part, plants) && right;
    }
    std::cout << tests << '\n' << explored << '\n' << plants;
    if (!everything || first.empty()) return right ? 0 : 1;
    std::ifstream file{std::string(first)};
    const std::string page{std::istreambuf_iterator<char>(file), {}};
    for (const auto& table : {tests, explored, plants})
        if (page.find(table) == std::string::npos) {
            std::cout << first << " has another table than this:\n" << table;
            right = false;
        }
    return right ? 0 : 1;
}

}  // namespace
}  // namespace orders

int main(int argc, char** argv) { return orders::run({argv + 1, argv + argc}); }
