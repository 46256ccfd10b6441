// Addresses, without sockets.
#include "node/modbus/allow_list.hpp"

#include <arpa/inet.h>
#include <gtest/gtest.h>

#include <cstring>

#include "config/network_address.hpp"

namespace tactiled::modbus {
namespace {

sockaddr_storage peer(const char* address) {
    sockaddr_storage storage{};
    auto& v4 = reinterpret_cast<sockaddr_in&>(storage);
    auto& v6 = reinterpret_cast<sockaddr_in6&>(storage);
    if (::inet_pton(AF_INET, address, &v4.sin_addr) == 1)
        storage.ss_family = AF_INET;
    else if (::inet_pton(AF_INET6, address, &v6.sin6_addr) == 1)
        storage.ss_family = AF_INET6;
    return storage;
}

TEST(AllowList, APrefixNeedNotEndAtAByte) {
    const AllowList list({"10.0.0.0/9", "192.168.1.64/27", "fd00:4::/30"});
    EXPECT_TRUE(list.allows(peer("10.127.255.255")));
    EXPECT_FALSE(list.allows(peer("10.128.0.0")));
    EXPECT_TRUE(list.allows(peer("192.168.1.95")));
    EXPECT_FALSE(list.allows(peer("192.168.1.96")));
    EXPECT_FALSE(list.allows(peer("192.168.1.63")));
    EXPECT_TRUE(list.allows(peer("fd00:7::1")));
    EXPECT_FALSE(list.allows(peer("fd00:8::1")));
}

TEST(AllowList, ListensWhereItIsConfigured) {
    const ListenAddress v6 = check_listen_address("[::1]:1502");
    EXPECT_EQ(v6.size, sizeof(sockaddr_in6));
    EXPECT_TRUE(same_host(v6.bytes, peer("::1")));
    EXPECT_EQ(ntohs(reinterpret_cast<const sockaddr_in6&>(v6.bytes).sin6_port), 1502);
    const ListenAddress v4 = check_listen_address("127.0.0.5:502");
    EXPECT_EQ(v4.size, sizeof(sockaddr_in));
    EXPECT_TRUE(same_host(v4.bytes, peer("127.0.0.5")));
}

}  // namespace
}  // namespace tactiled::modbus
