// tactilectl map: the register map, from the table that the server uses.
#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>

#include "node/ctl/command_line.hpp"
#include "node/ctl/map_text.hpp"
#include "node/ctl/verb.hpp"

namespace tactiled::ctl {

Run add_map(Command verb) {
    struct Args {
        std::string format = "md";
        bool json = false;
        unsigned sensors = 2;
    };
    auto args = std::make_shared<Args>();
    verb.add_option("--format", args->format,
                    "md: Markdown; csv: a row a register; st: IEC 61131-3 structured text; man: manual page")
        .one_of({"md", "csv", "st", "man"})
        .show_default();
    verb.add_flag("--json", args->json, "the same rows as csv, as JSON");
    verb.add_option("--sensors", args->sensors, "st: how many sensors to unpack").integer_in(1, 16).show_default();
    return [args] {
        fmt::print("{}", args->json              ? map_json()
                         : args->format == "csv" ? map_csv()
                         : args->format == "st"  ? map_structured_text(args->sensors)
                         : args->format == "man" ? map_manual_page()
                                                 : map_markdown());
        return kGood;
    };
}

}  // namespace tactiled::ctl
