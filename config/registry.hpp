// Lists of entries (drivers, serial formats, chips ...) to which each entry adds itself before main(), so that a new entry
// is one new file and one line in a CMakeLists.txt. The files must be linked as objects: a linker may drop an entry from a
// static library.
#pragma once
#include <algorithm>
#include <cassert>
#include <string>
#include <string_view>
#include <vector>

namespace tactiled {

// The list of all entries of one type. The last member of the type is its place in the list; `find` and `names` use its
// member `name`:
//
//     struct ChipEntry {
//         std::string_view name;
//         ...
//         Registry<ChipEntry> in_list{this};
//     };
//     const ChipEntry entry{.name = "ad7746", ...};                            // at namespace scope
//     const ChipEntry* found = Registry<ChipEntry>::find("ad7746");            // nullptr where no chip has that name
//
// The order of the list is the order of linking, so output for a user must be sorted. setup
template <class Entry>
class Registry {
public:
    explicit Registry(const Entry* entry) noexcept : entry_(entry), next_(first_) { first_ = this; }
    ~Registry() {  // a test may add an entry temporarily
        const Registry** at = &first_;
        while (*at != this) at = &(*at)->next_;
        *at = next_;
    }
    Registry(const Registry&) = delete;
    Registry& operator=(const Registry&) = delete;

    struct All {
        bool operator()(const Entry&) const noexcept { return true; }
    };

    // All entries that `accept` accepts, in the order of linking.
    template <class Accept = All>
    static std::vector<const Entry*> all(Accept accept = {}) {
        std::vector<const Entry*> found;
        for (const Registry* at = first_; at != nullptr; at = at->next_)
            if (accept(*at->entry_)) found.push_back(at->entry_);
        return found;
    }

    // Returns the entry with that name, of those that `accept` accepts; nullptr if there is none. Two entries with
    // the same name are an error of the program: without the assertion, the order of linking would choose between
    // them.
    template <class Accept = All>
    static const Entry* find(std::string_view name, Accept accept = {}) noexcept {
        const Entry* found = nullptr;
        for (const Registry* at = first_; at != nullptr; at = at->next_) {
            if (at->entry_->name != name || !accept(*at->entry_)) continue;
            assert(found == nullptr && "two entries have the same name");
            found = at->entry_;
        }
        return found;
    }

    // Returns the names of the entries that `accept` accepts, sorted.
    template <class Accept = All>
    static std::vector<std::string> names(Accept accept = {}) {
        std::vector<std::string> names;
        for (const Entry* entry : Registry::all(accept)) names.emplace_back(entry->name);
        std::sort(names.begin(), names.end());
        return names;
    }

private:
    inline static constinit const Registry* first_ = nullptr;  // initialised at compile time, so before any entry
    const Entry* entry_;
    mutable const Registry* next_;  // changes when an entry leaves the list
};

// A field of an entry without a default: an entry that omits it does not compile.
template <class Value>
class Required {
public:
    Required(Value value) noexcept : value_(value) {}
    operator Value() const noexcept { return value_; }

private:
    Value value_;
};

}  // namespace tactiled
