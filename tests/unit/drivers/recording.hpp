// A temporary recording like tactilectl's, with frames that the test specifies.
#pragma once
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "drivers/mcap/frame_message.hpp"
#include "drivers/mcap/writer.hpp"

namespace tactiled::mcap {

struct Recording {
    explicit Recording(const std::vector<std::string>& links) : writer(path, true) {
        const auto schema = writer.add_schema(std::string(kFrameSchema), "ros2msg", std::string(kFrameDefinition));
        for (const std::string& link : links)
            writer.add_channel(schema, "/n/link/" + link + "/frames", "cdr", {{std::string(kLinkKey), link}});
    }
    ~Recording() { std::remove(path.c_str()); }
    Recording(const Recording&) = delete;
    Recording& operator=(const Recording&) = delete;

    // `link`: its index in the list. The frame's only channel is its number.
    void frame(std::uint16_t link, std::uint64_t t_ns, double number) {
        Frame frame;
        frame.t_ns = t_ns;
        frame.n_channels = 1;
        frame.channel[0] = number;
        encode_frame(frame, t_ns, message);
        writer.message(link, 0, t_ns, message);
    }
    [[nodiscard]] std::string bytes() const {
        std::ifstream file(path, std::ios::binary);
        return {std::istreambuf_iterator<char>(file), {}};
    }
    void become(const std::string& bytes) const { std::ofstream(path, std::ios::binary) << bytes; }

    static std::string scratch_path() {
        const char* folder = std::getenv("TMPDIR");
        return std::string(folder != nullptr ? folder : "/tmp") + "/recording." + std::to_string(::getpid()) + ".mcap";
    }
    std::string path = scratch_path(), message;
    Writer writer;
};

}  // namespace tactiled::mcap
