// The places of the product's source at which an operation has a memory order, found while scenarios run; and plants, each
// of which weakens the order of one place.
#pragma once
#include <atomic>
#include <cstdint>
#include <map>
#include <source_location>
#include <string>
#include <vector>

namespace orders {

// `part` numbers the orders of one operation: 1 is a compare-exchange's order of failure.
struct Site {
    std::string file;  // from the project's folder on
    unsigned line = 0, column = 0, part = 0;
    auto operator<=>(const Site&) const = default;
};

enum class Use { load, store, modify, fence, call };  // `call`: a system call that orders memory or wakes a thread

struct Plant {
    Site site;
    Use use;
    std::memory_order from, to;  // `to` of a call is relaxed: the call is left out
};

// The order that the operation at this place has in this run. Notes the place.
std::memory_order order_at(const std::source_location& at, Use use, std::memory_order order, unsigned part = 0);

// Places noted since the last call of forget_sites() whose order is stronger than relaxed.
using Sites = std::map<Site, std::pair<Use, std::memory_order>>;
const Sites& sites();
void forget_sites();
// Every plant of a place: each next weaker order.
std::vector<Plant> plants_of(const Site& site, Use use, std::memory_order order);
// True if the place belongs to the explored part of the product.
bool is_product(const Site& site);
const char* name_of(std::memory_order order);
unsigned lines_of(const std::string& file);
// The line of source at the place, without what surrounds it.
std::string text_of(const Site& site);

}  // namespace orders
