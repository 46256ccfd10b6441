// gpio_edges CHIP LINE rising|falling: reports what drivers/gpio.hpp reads of a line. Each line on standard input is
// a time-out in ms to wait for edges, or "level", or "open"; each answer a line: "edge T_NS EDGES", "timeout",
// "gone", "level 0", "ok", or what is wrong.
#include <cstdint>
#include <iostream>
#include <string>

#include "drivers/gpio.hpp"

int main(int, char** argv) {
    using tactiled::GpioEdges;
    GpioEdges line;
    for (std::string word; std::getline(std::cin, word);) {
        std::uint64_t t_ns = 0;
        std::uint32_t edges = 0;
        if (word == "open") {
            line.close();
            const auto edge = std::string(argv[3]) == "rising" ? GpioEdges::Edge::rising : GpioEdges::Edge::falling;
            const std::string why = line.open({argv[1], argv[2]}, edge);
            std::cout << (why.empty() ? "ok" : why) << std::endl;
        } else if (word == "level") {
            std::cout << "level " << line.level() << std::endl;
        } else {
            switch (line.wait_edge(std::stoi(word), t_ns, edges)) {
                case GpioEdges::Wait::edge: std::cout << "edge " << t_ns << " " << edges << std::endl; break;
                case GpioEdges::Wait::timeout: std::cout << "timeout" << std::endl; break;
                case GpioEdges::Wait::disconnected: std::cout << "gone" << std::endl; break;
            }
        }
    }
}
