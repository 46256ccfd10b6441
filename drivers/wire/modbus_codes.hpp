// Function codes, exception codes and limits of the Modbus Application Protocol 1.1b3, for the server and for the master.
#pragma once
#include <cstddef>
#include <cstdint>

namespace tactiled {

enum class ModbusWire { rtu, tcp };

namespace modbus {

enum Function : std::uint8_t {
    kReadCoils = 1,
    kReadInputs = 2,
    kReadHolding = 3,
    kReadInputRegisters = 4,
    kWriteCoil = 5,
    kWriteRegister = 6,
    kDiagnostics = 8,
    kWriteCoils = 15,
    kWriteRegisters = 16,
    kReportServerId = 17,
    kMaskWrite = 22,
    kReadWrite = 23,
    kEncapsulated = 43
};
inline constexpr std::uint8_t kReadIdentity = 14;           // the MEI type of function 43 that is served
inline constexpr std::uint8_t kBasic = 1, kIndividual = 4;  // its first and last read device id code: 6.21
inline constexpr std::uint8_t kExceptionBit = 0x80;         // set in the function code of an answer that is an exception

enum Exception : std::uint8_t {
    kNone = 0,
    kIllegalFunction = 1,
    kIllegalAddress = 2,
    kIllegalValue = 3,
    kDeviceFailure = 4,
    kBusy = 6
};

inline constexpr std::size_t kMbapSize = 7;  // transaction, protocol, length, unit
inline constexpr std::size_t kCrcSize = 2;
inline constexpr std::size_t kMaxPdu = 253;                  // 4.1
inline constexpr std::size_t kMaxAdu = kMbapSize + kMaxPdu;  // TCP
inline constexpr std::size_t kMaxRtu = 1 + kMaxPdu + kCrcSize;

inline constexpr unsigned kMaxRead = 125, kMaxWrite = 123, kMaxWriteBeside = 121;  // registers: 6.3, 6.12, 6.17
inline constexpr unsigned kMaxReadBits = 2000, kMaxWriteBits = 1968;               // 6.1, 6.11

}  // namespace modbus
}  // namespace tactiled
