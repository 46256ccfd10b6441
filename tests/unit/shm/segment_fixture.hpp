// A segment in real shared memory, its plan and its samples, for the tests of writer and readers.
#pragma once
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <fstream>
#include <memory>
#include <thread>

#include "node/control.hpp"
#include "node/shm/folder.hpp"
#include "node/shm/writer.hpp"
#include "tactiled/reader.hpp"

namespace tactiled {

// Publishes a node record, so that the daemon counts as alive.
inline void beat(SegmentWriter& writer, std::uint64_t number) {
    tactiled_node node{};
    node.sequence = number;
    node.t_ns = monotonic_ns();
    writer.publish(node);
}

class SegmentTest : public testing::Test {
protected:
    std::string name_ = "test-" + std::to_string(::getpid());
    std::string path_ = runtime_folder() + "/tactiled." + name_;
    ~SegmentTest() override { ::unlink(path_.c_str()); }

    SegmentPlan plan(std::size_t sensors = 1) const {
        SegmentPlan p;
        p.name = name_;
        p.version = "test";
        p.history = 64;
        for (std::size_t i = 0; i < sensors; ++i) {
            tactiled_sensor s{};
            ("s" + std::to_string(i)).copy(s.name, sizeof s.name - 1);
            s.stale_ms = 100;
            p.sensors.push_back(s);
        }
        return p;
    }
    // A writer that counts as a running daemon.
    std::unique_ptr<SegmentWriter> alive() const {
        auto writer = std::make_unique<SegmentWriter>(plan());
        writer->set_state(TACTILED_RUNNING);
        beat(*writer, 0);
        return writer;
    }
    static tactiled_sample sample(std::uint64_t number) {
        tactiled_sample s{};
        s.sequence = number;
        s.t_ns = s.t_published_ns = monotonic_ns();
        s.quality = TACTILED_GOOD;
        for (int i = 0; i < 3; ++i) s.force_S_N[i] = s.raw_force_S_N[i] = s.torque_S_Nm[i] = double(number);
        return s;
    }
};

}  // namespace tactiled
