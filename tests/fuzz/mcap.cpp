// Any bytes as a recording: the reader ends, stays inside of the bytes, and a second reading gives the same, also one from
// the disk.
#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <string_view>

#include "drivers/mcap/format.hpp"
#include "drivers/mcap/frame_message.hpp"
#include "drivers/mcap/message_file.hpp"
#include "drivers/mcap/reader.hpp"

using namespace tactiled;

namespace {

struct Seen {
    std::size_t messages = 0, bytes = 0, frames = 0;
    bool operator==(const Seen&) const = default;
};

Seen read_all(mcap::Reader& reader, std::string_view file) {
    Seen seen;
    Frame frame;
    while (const auto message = reader.next()) {
        if (message->data.data() < file.data() || message->data.data() + message->data.size() > file.data() + file.size())
            std::abort();
        bool declared = false;
        for (const auto& [number, channel] : reader.channels()) declared |= &channel == message->channel;
        if (!declared) std::abort();
        ++seen.messages;
        seen.bytes += message->data.size();
        if (mcap::decode_frame(message->data, frame)) {
            ++seen.frames;
            if (frame.n_channels > kMaxChannels) std::abort();
            std::string again;
            mcap::encode_frame(frame, message->time_ns, again);
            Frame back;
            // Bit by bit, but for a flag that has more than one way to say yes.
            if (!mcap::decode_frame(again, back) || std::memcmp(&frame.channel, &back.channel, sizeof frame.channel) != 0 ||
                frame.t_ns != back.t_ns || frame.sequence != back.sequence || frame.missing != back.missing ||
                frame.device != back.device || frame.lost != back.lost || frame.saturated != back.saturated)
                std::abort();
        }
    }
    return seen;
}

Seen read_from_disk(std::string_view bytes) {
    static const int fd = ::memfd_create("recording", 0);
    static const std::string path = "/proc/self/fd/" + std::to_string(fd);
    if (::ftruncate(fd, 0) != 0 || ::pwrite(fd, bytes.data(), bytes.size(), 0) != ssize_t(bytes.size())) std::abort();
    static mcap::MessageFile file;
    if (!file.open(path).empty()) std::abort();
    Seen seen;
    Frame frame;
    for (;;) {
        const auto message = file.next(100);
        if (!message && file.at_end()) return seen;
        if (!message) continue;
        ++seen.messages;
        seen.bytes += message->data.size();
        seen.frames += mcap::decode_frame(message->data, frame);
    }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    std::string file(mcap::kMagic);
    file.append(reinterpret_cast<const char*>(data), size);
    mcap::Reader reader(file);
    const Seen first = read_all(reader, file);
    mcap::Reader another(file);
    if (!(read_all(another, file) == first)) std::abort();
    if (!(read_from_disk(file) == first)) std::abort();
    if (first.bytes > file.size()) std::abort();  // no byte is given twice
    (void)reader.why();
    return 0;
}
