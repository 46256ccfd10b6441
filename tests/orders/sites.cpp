#include "sites.hpp"

#include <algorithm>
#include <fstream>
#include <iterator>
#include <unordered_map>

#include "explorer.hpp"

namespace orders {
namespace {

constexpr std::string_view kRoot = TACTILED_SOURCE_DIR "/";

Sites& noted() {
    static Sites map;
    return map;
}

// The same place has one Site, whatever the address of its file's name.
const Site& site_of(const std::source_location& at, unsigned part) {
    static std::unordered_map<std::uint64_t, Site> known;
    const auto key = reinterpret_cast<std::uint64_t>(at.file_name()) * 0x9E3779B97F4A7C15u ^
                     (std::uint64_t(at.line()) << 20 | std::uint64_t(at.column()) << 4 | part);
    if (const auto found = known.find(key); found != known.end()) return found->second;
    std::string_view file = at.file_name();
    if (file.starts_with(kRoot)) file.remove_prefix(kRoot.size());
    while (file.starts_with("../")) file.remove_prefix(3);  // ccache may make it relative to the folder of the build
    return known.emplace(key, Site{std::string(file), at.line(), at.column(), part}).first->second;
}

}  // namespace

std::memory_order order_at(const std::source_location& at, Use use, std::memory_order order, unsigned part) {
    if (order == std::memory_order_relaxed || explorer().thread() < 0) return order;
    const Site& site = site_of(at, part);
    noted().try_emplace(site, use, order);
    const Plant* const plant = explorer().plant();
    return plant != nullptr && plant->site == site ? plant->to : order;
}

const Sites& sites() { return noted(); }
void forget_sites() { noted().clear(); }

std::vector<Plant> plants_of(const Site& site, Use use, std::memory_order from) {
    using enum std::memory_order;
    std::vector<std::memory_order> weaker = {relaxed};  // from acquire and release; a call is left out
    if (from == acq_rel) weaker = {acquire, release};
    if (from == seq_cst && use != Use::call) weaker = {use == Use::load ? acquire : use == Use::store ? release : acq_rel};
    std::vector<Plant> plants;
    for (const auto to : weaker) plants.push_back({site, use, from, to});
    return plants;
}

bool is_product(const Site& site) {
    constexpr std::string_view kAgainstTheKernel = "node/include/tactiled/mapping.h";  // removes pages of a truncated file
    return !site.file.starts_with("tests/") && !site.file.starts_with("/") && site.file != kAgainstTheKernel;
}

const char* name_of(std::memory_order order) {
    switch (order) {
        case std::memory_order_relaxed: return "relaxed";
        case std::memory_order_consume: return "consume";
        case std::memory_order_acquire: return "acquire";
        case std::memory_order_release: return "release";
        case std::memory_order_acq_rel: return "acq_rel";
        case std::memory_order_seq_cst: return "seq_cst";
    }
    return "?";
}

unsigned lines_of(const std::string& file) {
    std::ifstream text(std::string(kRoot) + file);
    return unsigned(std::count(std::istreambuf_iterator<char>(text), {}, '\n'));
}

std::string text_of(const Site& site) {
    std::ifstream file(std::string(kRoot) + site.file);
    std::string line;
    for (unsigned n = 0; n < site.line && std::getline(file, line);) ++n;
    for (const char* const comment : {"//", "/*"}) line.resize(std::min(line.size(), line.find(comment)));
    for (const std::string_view word : {"std::memory_order_", "[[nodiscard]] "})
        for (auto at = line.find(word); at != std::string::npos; at = line.find(word)) line.erase(at, word.size());
    const auto first = line.find_first_not_of(" \t"), last = line.find_last_not_of(" \t");
    return first == std::string::npos ? "" : line.substr(first, last - first + 1);
}

}  // namespace orders
