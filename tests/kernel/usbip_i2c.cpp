// Emulates an i2c-tiny-usb adapter for the kernel of the test machine, through vhci_hcd and a socket pair: a real
// /dev/i2c-N whose chips are the models of the unit tests, in real time. Needs the modules vhci-hcd, i2c-tiny-usb,
// i2c-dev.
//
//     usbip_i2c PORT KIND:ADDRESS[:MUX:CHANNEL]...      such as usbip_i2c 0 ad7746:0x48:0x70:2 nau7802:0x2a
//
// Commands, one a line; N counts the chips: dead N 0|1 | reset N | swap N KIND | muxes (reset) | hang 0|1 | unplug | plug |
// line N FILE (of gpio-sim, which falls when a conversion of the chip ends) | select N FILE... (values of gpio-sim's lines,
// the lowest bit first, that turn the switch before an AD7746) | pF N ELECTRODE NUMBER (what that one then has) | report
// FILE (counts, as JSON). The end of the input ends it. Vendor requests: the kernel's drivers/i2c/busses/i2c-tiny-usb.c.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <linux/i2c.h>
#include <poll.h>

#include <cstdio>
#include <cstring>
#include <fstream>
#include <iostream>
#include <sstream>

#include "drivers/clock.hpp"
#include "tests/kernel/usbip.hpp"
#include "tests/unit/drivers/chip_bench.hpp"

namespace {

using namespace tactiled;
using namespace tactiled::test;

using namespace tactiled::test::usbip;

constexpr std::uint8_t kDevice[] = {18, 1, 0x10, 0x01, 0, 0, 0, 8, 0x03, 0x04, 0x31, 0xC6, 0x05, 0x01, 1, 2, 3, 1};
constexpr std::uint8_t kConfiguration[] = {9, 2, 18, 0, 1, 1, 0, 0x80, 50, 9, 4, 0, 0, 0, 0xFF, 0, 0, 0};
constexpr const char* kStrings[] = {"", "tactiled-test", "i2c-tiny-usb", "0001"};

std::unique_ptr<ModelChip> make(const std::string& name) {
    for (const ChipKind& kind : chip_kinds())
        if (kind.name == name) return kind.make_model();
    throw std::runtime_error("no model of a chip " + name);
}

class Adapter {
public:
    Adapter(int port, int n_chips, char** chips) : port_(port) {
        for (int i = 0; i < n_chips; ++i) {
            std::string text = chips[i];
            for (char& c : text)
                if (c == ':') c = ' ';
            std::istringstream words(text);
            words.unsetf(std::ios::basefield);  // 0x48
            std::string name;
            unsigned address = 0, mux = 0, channel = 0;
            words >> name >> address >> mux >> channel;
            models_.push_back(make(name));
            places_.push_back({std::uint8_t(address), std::uint8_t(mux), channel});
        }
        wire();
        fd_ = plug(port_, 1);
    }

    void run() {
        for (std::string line;;) {
            pollfd ready[2] = {{0, POLLIN, 0}, {fd_, POLLIN, 0}};
            const timespec wait = drive_line();
            if (::ppoll(ready, fd_ >= 0 ? 2 : 1, &wait, nullptr) < 0) return;
            if (ready[0].revents != 0) {
                char c = 0;
                if (::read(0, &c, 1) <= 0) return;
                if (c != '\n') {
                    line += c;
                } else {
                    obey(line);
                    line.clear();
                }
            } else if (fd_ >= 0 && ready[1].revents != 0 && !serve()) {
                unplug();
            }
        }
    }

private:
    struct Place {
        std::uint8_t address, mux;
        unsigned channel;
    };

    void wire() {
        wires_ = {};
        for (std::size_t i = 0; i < models_.size(); ++i)
            wires_.put(places_[i].address, *models_[i], places_[i].mux, places_[i].channel);
    }
    void unplug() {
        if (fd_ >= 0) ::close(fd_);
        fd_ = -1;
    }

    void obey(const std::string& line) {
        std::istringstream words(line);
        std::string what, name;
        std::size_t n = 0;
        words >> what;
        if (what == "hang") {
            words >> hangs_;
        } else if (what == "unplug") {
            unplug();
        } else if (what == "plug") {
            fd_ = plug(port_, 1);
        } else if (what == "muxes") {
            wires_.reset_muxes();
        } else if (what == "report") {
            words >> name;
            std::vector<std::uint32_t> converted;
            for (const auto& model : models_) converted.push_back(model->n_converted);
            std::ofstream(name + ".new") << fmt::format(
                "{{\"nacks\": {}, \"asked\": {}, \"converted\": [{}], \"edge\": [{}, {}, {}]}}\n", n_nacks_, n_asked_,
                fmt::join(converted, ", "), edge_.number, edge_.before_ns, edge_.after_ns);
            std::rename((name + ".new").c_str(), name.c_str());
        } else if (words >> n && n < models_.size()) {
            if (what == "dead") words >> models_[n]->is_dead;
            if (what == "reset") models_[n]->reset();
            if (what == "line" && words >> name) lined_ = n, pull_.open(name);
            if (what == "select") select(n, words);
            if (what == "pF") set_electrode(n, words);
            if (what == "swap" && words >> name) models_[n] = make(name), wire();
        }
    }

    void select(std::size_t n, std::istream& words) {
        switched_ = dynamic_cast<ModelAd7746*>(models_[n].get());
        select_lines_.clear();
        for (std::string name; words >> name;) select_lines_.push_back(name);
    }
    void set_electrode(std::size_t n, std::istream& words) {
        unsigned electrode = 0;
        double pF = 0;
        words >> electrode >> pF;
        codes_[electrode] = std::uint32_t(std::lround(0x800000 + pF * (0x800000 / 4.096)));
        dynamic_cast<ModelAd7746&>(*models_[n]).code_of = [this](unsigned input) {
            const auto found = codes_.find(input);
            return found == codes_.end() ? std::nullopt : std::optional(found->second);
        };
    }
    // Updates the switch from its lines before the chip receives anything else.
    void turn_switch() {
        if (switched_ == nullptr) return;
        unsigned electrode = 0;
        for (std::size_t bit = 0; bit < select_lines_.size(); ++bit) {
            std::ifstream file(select_lines_[bit]);
            if (file.get() == '1') electrode |= 1u << bit;
        }
        switched_->select(electrode, tactiled::now_ns());
    }

    // Lets the line of gpio-sim fall when a conversion of its chip has ended. Returns the time until the next
    // possible event.
    timespec drive_line() {
        if (!pull_.is_open()) return {3600, 0};
        ModelChip& chip = *models_[lined_];
        chip.advance(tactiled::now_ns());
        if (chip.ended_ns() != reported_ns_) {
            reported_ns_ = chip.ended_ns();
            pull_ << "pull-up" << std::flush;
            edge_ = {chip.n_converted, tactiled::now_ns(), 0};
            pull_ << "pull-down" << std::flush;
            edge_.after_ns = tactiled::now_ns();
        }
        const std::uint64_t now_ns = tactiled::now_ns(), ends_ns = chip.ends_ns();
        return {0, ends_ns == 0        ? 1'000'000
                   : ends_ns <= now_ns ? 0
                                       : long(std::min<std::uint64_t>(ends_ns - now_ns, 999'999'999))};
    }

    // Handles one request of the kernel. Returns false if the kernel has released the device.
    bool serve() {
        Header request;
        if (!read_all(fd_, &request, sizeof request)) return false;
        Header answer{};
        answer.sequence = request.sequence;
        if (ntohl(request.command) == kUnlink) {  // timed out, or cancelled
            answer.command = htonl(kUnlinked);
            answer.answer.status = htonl(std::uint32_t(-ECONNRESET));
            return ::write(fd_, &answer, sizeof answer) == ssize_t(sizeof answer);
        }
        const bool in = ntohl(request.direction) == 1;
        std::vector<std::uint8_t> data(ntohl(request.submit.length));
        if (!in && !data.empty() && !read_all(fd_, data.data(), data.size())) return false;
        const std::uint8_t* const setup = request.submit.setup;
        const std::size_t asked = data.size();
        int status = 0;
        if ((setup[0] & 0x60) == 0x40) {
            if (hangs_ && setup[1] >= 4) return true;  // never answered: the kernel gives up after 2 s
            vendor(setup[1], std::uint8_t(setup[4]), in, data);
        } else {
            status = standard(setup, data);
        }
        if (data.size() > asked) data.resize(asked);
        answer.command = htonl(kSubmitted);
        answer.answer.status = htonl(std::uint32_t(status));
        answer.answer.length = htonl(std::uint32_t(data.size()));
        if (::write(fd_, &answer, sizeof answer) != ssize_t(sizeof answer)) return false;
        return !in || data.empty() || ::write(fd_, data.data(), data.size()) == ssize_t(data.size());
    }

    void vendor(std::uint8_t request, std::uint8_t address, bool in, std::vector<std::uint8_t>& data) {
        if (request == 1) {
            const std::uint32_t functions = I2C_FUNC_I2C | I2C_FUNC_SMBUS_EMUL;
            data.assign(reinterpret_cast<const std::uint8_t*>(&functions),
                        reinterpret_cast<const std::uint8_t*>(&functions + 1));
        } else if (request == 3) {
            data.assign(1, acknowledged_ ? 1 : 2);
        } else if (request >= 4 && request <= 7) {
            turn_switch();
            const std::uint64_t t_ns = tactiled::now_ns();
            ++n_asked_;
            acknowledged_ = in ? wires_.read(address, data, t_ns, t_ns) : wires_.write(address, data, t_ns);
            if (!acknowledged_) ++n_nacks_;
        }
    }

    static int standard(const std::uint8_t* setup, std::vector<std::uint8_t>& data) {
        const std::uint8_t which = setup[2], kind = setup[3];
        if (setup[1] == 0) {
            data.assign(2, 0);
        } else if (setup[1] == 6 && kind == 1) {
            data.assign(std::begin(kDevice), std::end(kDevice));
        } else if (setup[1] == 6 && kind == 2) {
            data.assign(std::begin(kConfiguration), std::end(kConfiguration));
        } else if (setup[1] == 6 && kind == 3 && which < std::size(kStrings)) {
            data = which == 0 ? std::vector<std::uint8_t>{4, 3, 9, 4} : std::vector<std::uint8_t>{0, 3};
            for (const char* c = kStrings[which]; *c != 0; ++c) data.insert(data.end(), {std::uint8_t(*c), 0});
            data[0] = std::uint8_t(data.size());
        } else if (setup[1] == 6) {
            data.clear();
            return -EPIPE;
        }
        return 0;
    }

    std::ofstream pull_;
    std::size_t lined_ = 0;
    std::uint64_t reported_ns_ = 0;
    struct {
        std::uint32_t number;  // number of the conversion
        std::uint64_t before_ns, after_ns;
    } edge_{};
    ModelAd7746* switched_ = nullptr;
    std::vector<std::string> select_lines_;
    std::map<unsigned, std::uint32_t> codes_;
    int port_, fd_ = -1;
    bool hangs_ = false, acknowledged_ = true;
    unsigned n_nacks_ = 0, n_asked_ = 0;
    std::vector<std::unique_ptr<ModelChip>> models_;
    std::vector<Place> places_;
    ModelWires wires_;
};

}  // namespace

int main(int n_words, char** words) try {
    if (n_words < 3) throw std::runtime_error("usage: usbip_i2c PORT KIND:ADDRESS[:MUX:CHANNEL]...");
    Adapter(std::atoi(words[1]), n_words - 2, words + 2).run();
    return 0;
} catch (const std::exception& error) {
    std::cerr << "usbip_i2c: " << error.what() << '\n';
    return 1;
}
