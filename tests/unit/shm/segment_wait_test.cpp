// Readers that wait.
#include "node/shm/waker.hpp"
#include "segment_fixture.hpp"
#include "tests/unit/stopwatch.hpp"

namespace tactiled {
namespace {

TEST_F(SegmentTest, EveryWayOfWaitingGivesEverySample) {
    SegmentWriter writer(plan());
    writer.set_state(TACTILED_RUNNING);
    std::uint64_t number = 0, beats = 0;
    for (const Wait how : {Wait::poll, Wait::predict, Wait::block}) {
        beat(writer, beats++);
        Reader reader(name_, "s0");
        std::atomic<bool> stop{false};
        std::thread daemon([&] {
            while (!stop) {
                writer.publish(0, sample(number++));
                beat(writer, beats++);
                writer.wake_readers(INT_MAX);
                ::usleep(1000);
            }
        });
        tactiled_sample s{};
        ASSERT_TRUE(reader.wait(s, 1000, how));
        for (std::uint64_t next = s.sequence + 1, end = next + 200; next < end; ++next) {
            ASSERT_TRUE(reader.wait(s, 1000, how));
            ASSERT_EQ(s.sequence, next);
        }
        EXPECT_EQ(reader.lost(), 0u);
        stop = true;
        daemon.join();
    }
}

TEST_F(SegmentTest, ManyReadersAreWokenAFewAtATimeAndEachGetsEverySample) {
    constexpr int kReaders = 20;
    constexpr std::uint64_t kSamples = 100;
    SegmentWriter writer(plan());
    writer.set_state(TACTILED_RUNNING);
    beat(writer, 0);
    Waker waker(writer);
    std::thread thread([&] { waker.run(); });
    std::atomic<int> complete{0};
    std::vector<std::thread> readers;
    for (int i = 0; i < kReaders; ++i)
        readers.emplace_back([&] {
            tactiled_reader reader;
            tactiled_reader_init(&reader, name_.c_str(), "s0");
            reader.wake = static_cast<std::uint32_t*>(
                ::mmap(nullptr, sizeof(tactiled_wake), PROT_READ | PROT_WRITE, MAP_SHARED, writer.wake_page(), 0));
            tactiled_sample s;
            s.sequence = 0;
            while (s.sequence + 1 < kSamples && tactiled_reader_wait(&reader, &s, 5000, TACTILED_BLOCK) != 0) {}
            if (s.sequence + 1 == kSamples && reader.cursor.lost == 0) ++complete;
            tactiled_reader_detach(&reader);
        });
    ::usleep(100'000);
    for (std::uint64_t n = 0; n < kSamples; ++n) {
        writer.publish(0, sample(n));
        beat(writer, n + 1);
        waker.published();
        ::usleep(5'000);
    }
    for (auto& reader : readers) reader.join();
    waker.stop();
    thread.join();
    EXPECT_EQ(complete, kReaders);
}

TEST_F(SegmentTest, AReaderCannotCutTheWakePage) {
    const SegmentWriter writer(plan());
    EXPECT_NE(::ftruncate(writer.wake_page(), 0), 0);  // the daemon would read it: a SIGBUS
    EXPECT_EQ(::fcntl(writer.wake_page(), F_GET_SEALS), F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL);
}

TEST_F(SegmentTest, ASleepingReaderIsWokenWhateverTheCountAndTheOldRequest) {
    for (const auto& [first, request] : {std::pair{std::uint64_t(0), 0u},
                                         {(1ull << 31) + 256, 0u},    // the request of an empty page
                                         {1000, 1000u + (1u << 30)},  // request of a reader that wrote invalid data
                                         {1000, 1000u + TACTILED_WAKE_RECORDS + 9},  // more than the daemon accepts
                                         {(1ull << 32) - 20, 0u}}) {
        SegmentWriter writer(plan());
        writer.set_state(TACTILED_RUNNING);
        beat(writer, first);
        writer.publish(0, sample(0));
        tactiled_reader reader;
        tactiled_reader_init(&reader, name_.c_str(), "s0");
        reader.wake = static_cast<std::uint32_t*>(
            ::mmap(nullptr, sizeof(tactiled_wake), PROT_READ | PROT_WRITE, MAP_SHARED, writer.wake_page(), 0));
        __atomic_store_n(reader.wake, request, __ATOMIC_RELAXED);
        std::atomic<bool> stop{false};
        std::thread daemon([&, beats = first + 1]() mutable {
            for (std::uint64_t n = 1; !stop; ++n) {
                ::usleep(7'000);  // far from the 20 ms after which a reader wakes automatically
                tactiled_sample s = sample(n);
                s.t_published_ns = s.t_ns;
                writer.publish(0, s);
                beat(writer, beats++);
                writer.wake_readers(INT_MAX);
            }
        });
        std::vector<std::uint64_t> late_ns;
        tactiled_sample s{};
        ASSERT_TRUE(tactiled_reader_wait(&reader, &s, 1000, TACTILED_BLOCK));
        while (late_ns.size() < 51) {
            ASSERT_TRUE(tactiled_reader_wait(&reader, &s, 1000, TACTILED_BLOCK));
            late_ns.push_back(monotonic_ns() - s.t_published_ns);
        }
        stop = true;
        daemon.join();
        tactiled_reader_detach(&reader);
        std::nth_element(late_ns.begin(), late_ns.begin() + 25, late_ns.end());
        EXPECT_LT(late_ns[25], 2'000'000u) << first << " " << request;
    }
}

TEST_F(SegmentTest, AControlSocketThatDoesNotAnswerDelaysNoWaitAndIsAskedAgain) {
    SegmentPlan p = plan();
    p.control = "/tmp/tactiled-" + name_ + ".sock";
    p.watchdog_ms = 10'000;
    SegmentWriter writer(p);
    writer.set_state(TACTILED_RUNNING);
    beat(writer, 0);
    writer.publish(0, sample(0));
    const auto took_ms = [](tactiled_reader& reader, std::uint32_t timeout_ms) {
        tactiled_sample s{};
        while (tactiled_reader_next(&reader, &s) != 0) {}
        const Stopwatch watch;
        EXPECT_FALSE(tactiled_reader_wait(&reader, &s, timeout_ms, TACTILED_BLOCK));
        return double(watch.ns()) / 1e6;
    };
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    p.control.copy(address.sun_path, sizeof address.sun_path - 1);
    const int hung = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    ASSERT_EQ(::bind(hung, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    ASSERT_EQ(::listen(hung, 1), 0);
    std::vector<int> queued;
    for (const bool full : {false, true}) {
        for (int last = 0; full && last == 0;) {
            queued.push_back(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
            last = ::connect(queued.back(), reinterpret_cast<const sockaddr*>(&address), sizeof address);
        }
        tactiled_reader reader;
        tactiled_reader_init(&reader, name_.c_str(), "s0");
        EXPECT_LT(took_ms(reader, 5), 100) << full;   // 6 on an idle machine; it asked for a second
        EXPECT_LT(took_ms(reader, 50), 150) << full;  // and does not ask again
        if (!full) {
            tactiled_reader_detach(&reader);
            continue;
        }
        std::string why;
        const Stopwatch watch;
        EXPECT_EQ(ask_daemon(p.control, "?", 50, why), "");  // like tactilectl and a new daemon
        EXPECT_LT(watch.ns(), 500'000'000u);
        ::close(hung);
        for (const int s : queued) ::close(s);
        CommandRing commands(4);
        const ControlSocket control(p.control, "", name_, writer, "", commands);
        took_ms(reader, 1200);
        EXPECT_NE(reader.wake, nullptr);
        tactiled_reader_detach(&reader);
    }
}

}  // namespace
}  // namespace tactiled
