// SPDX-License-Identifier: GPL-3.0-or-later
// The transport under clients that are slow, silent, many, or rude.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <atomic>
#include <cstring>
#include <thread>

#include "tools/mapcodecd/config/listen_address.hpp"
#include "tools/mapcodecd/http/http_listener.hpp"

namespace mapcodec::daemon {
namespace {

using namespace std::chrono_literals;
const std::string kRequest = "GET / HTTP/1.1\r\n\r\n";

/// Takes the request off the connection and answers with its length.
bool echo_length(Connection& connection) {
  char bytes[1000];
  std::size_t length = 0;
  while (const std::size_t count = connection.take(bytes, sizeof bytes)) length += count;
  return connection.send(std::to_string(length) + "\n");
}

HttpSettings small() {
  HttpSettings s;
  s.listen = {"127.0.0.1:0"};
  s.workers = 2;
  s.read_timeout_s = 0.5;
  s.idle_timeout_s = 5;
  s.write_timeout_s = 0.5;
  return s;
}

std::unique_ptr<HttpListener> started(const HttpSettings& settings, HttpListener::Serve serve = echo_length) {
  auto listener = HttpListener::start(settings, std::move(serve));
  EXPECT_TRUE(listener.ok()) << listener.error().message;
  return std::move(listener).value();
}

class Client {
 public:
  explicit Client(const HttpListener& listener) : socket_(socket(AF_INET, SOCK_STREAM, 0)) {
    const auto address = parse_listen_address(listener.addresses()[0]);
    sockaddr_in name{};
    name.sin_family = AF_INET;
    name.sin_port = htons(address->port);
    inet_pton(AF_INET, address->host.c_str(), &name.sin_addr);
    connected_ = connect(socket_.fd(), reinterpret_cast<const sockaddr*>(&name), sizeof name) == 0;
  }
  [[nodiscard]] bool connected() const { return connected_; }
  bool say(std::string_view text) {
    return ::send(socket_.fd(), text.data(), text.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(text.size());
  }
  /// What comes within the time; empty: nothing, or the end.
  std::string hear(std::chrono::milliseconds time = 5s) {
    pollfd waiter{socket_.fd(), POLLIN, 0};
    if (poll(&waiter, 1, static_cast<int>(time.count())) != 1) return {};
    char bytes[4096];
    const ssize_t count = recv(socket_.fd(), bytes, sizeof bytes, 0);
    return count <= 0 ? std::string() : std::string(bytes, static_cast<std::size_t>(count));
  }
  /// True once the server has closed it.
  bool ends(std::chrono::milliseconds time = 5s) {
    pollfd waiter{socket_.fd(), POLLIN, 0};
    char byte = 0;
    return poll(&waiter, 1, static_cast<int>(time.count())) == 1 && recv(socket_.fd(), &byte, 1, 0) <= 0;
  }

 private:
  FileHandle socket_;
  bool connected_ = false;
};

TEST(HttpListener, AnswersAndKeepsTheConnection) {
  const auto listener = started(small());
  Client client(*listener);
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(client.say(kRequest));
    EXPECT_EQ(client.hear(), "18\n");
  }
}

TEST(HttpListener, RequestInPiecesIsOneRequest) {
  const auto listener = started(small());
  Client client(*listener);
  for (const char c : kRequest) ASSERT_TRUE(client.say({&c, 1}));
  EXPECT_EQ(client.hear(), "18\n");
}

TEST(HttpListener, SlowClientsHoldNoWorkerAndAreCutOff) {
  const auto listener = started(small());  // two workers
  std::vector<std::unique_ptr<Client>> slow;
  for (int i = 0; i < 50; ++i) {
    slow.push_back(std::make_unique<Client>(*listener));
    ASSERT_TRUE(slow.back()->say("GET /"));
  }
  std::atomic<bool> stop{false};
  std::jthread trickle([&] {
    while (!stop) {
      for (const auto& client : slow) client->say("x");
      std::this_thread::sleep_for(50ms);
    }
  });
  Client honest(*listener);
  ASSERT_TRUE(honest.say(kRequest));
  EXPECT_EQ(honest.hear(), "18\n");
  for (const auto& client : slow) EXPECT_TRUE(client->ends());  // although a byte came every 50 ms
  stop = true;
  EXPECT_GE(listener->figures().timed_out, 50u);
}

TEST(HttpListener, SilentClientsMakeRoom) {
  HttpSettings settings = small();
  settings.max_connections = 10;
  const auto listener = started(settings);
  std::vector<std::unique_ptr<Client>> silent;
  for (int i = 0; i < 100; ++i) silent.push_back(std::make_unique<Client>(*listener));
  Client honest(*listener);
  ASSERT_TRUE(honest.say(kRequest));
  EXPECT_EQ(honest.hear(), "18\n");
  EXPECT_LE(listener->figures().connections, 10u);
  EXPECT_GE(listener->figures().evicted, 91u);
}

TEST(HttpListener, LongHeadersAreRefused) {
  HttpSettings settings = small();
  settings.max_header_bytes = 1000;
  const auto listener = started(settings);
  Client client(*listener);
  ASSERT_TRUE(client.say("GET / HTTP/1.1\r\nA: " + std::string(8000, 'x')));
  EXPECT_EQ(client.hear().substr(0, 12), "HTTP/1.1 431");
}

TEST(HttpListener, FullQueueSaysBusy) {
  HttpSettings settings = small();
  settings.workers = 1;
  settings.max_waiting = 2;
  std::atomic<bool> go{false};
  const auto listener = started(settings, [&go](Connection& connection) {
    while (!go) std::this_thread::sleep_for(1ms);
    return echo_length(connection);
  });
  std::vector<std::unique_ptr<Client>> clients;
  for (int i = 0; i < 10; ++i) {
    clients.push_back(std::make_unique<Client>(*listener));
    ASSERT_TRUE(clients.back()->say(kRequest));
    std::this_thread::sleep_for(10ms);
  }
  while (listener->figures().refused < 7) std::this_thread::sleep_for(1ms);
  go = true;
  int served = 0, busy = 0;
  for (const auto& client : clients) {
    const std::string answer = client->hear();
    served += answer == "18\n";
    busy += answer.rfind("HTTP/1.1 503", 0) == 0;
  }
  EXPECT_EQ(served, 3);
  EXPECT_EQ(busy, 7);
}

TEST(HttpListener, ReaderThatDoesNotReadIsCutOff) {
  std::atomic<int> outcome{-1};
  const auto listener = started(small(), [&outcome](Connection& connection) {
    outcome = connection.send(std::string(64 << 20, 'x')) ? 1 : 0;
    return false;
  });
  Client client(*listener);
  ASSERT_TRUE(client.say(kRequest));
  const auto begin = std::chrono::steady_clock::now();
  while (outcome < 0) std::this_thread::sleep_for(10ms);
  EXPECT_EQ(outcome, 0);
  EXPECT_LT(std::chrono::steady_clock::now() - begin, 20s);
}

TEST(HttpListener, StopsWhileClientsAreConnected) {
  auto listener = started(small());
  Client idle(*listener), half(*listener);
  ASSERT_TRUE(half.say("GET"));
  listener->stop(std::chrono::steady_clock::now() + 1s);
  EXPECT_TRUE(idle.ends());
  EXPECT_TRUE(half.ends());
  EXPECT_FALSE(Client(*listener).connected());
}

TEST(HttpListener, SocketIsPrivateAndReplacesAStaleOne) {
  HttpSettings settings = small();
  const std::string path = testing::TempDir() + "listener_test.sock";
  unlink(path.c_str());
  settings.listen = {"unix:" + path};
  {
    const FileHandle dead(socket(AF_UNIX, SOCK_STREAM, 0));
    sockaddr_un name{};
    name.sun_family = AF_UNIX;
    std::strncpy(name.sun_path, path.c_str(), sizeof name.sun_path - 1);
    ASSERT_EQ(bind(dead.fd(), reinterpret_cast<const sockaddr*>(&name), sizeof name), 0);
  }
  auto listener = started(settings);
  struct stat status {};
  ASSERT_EQ(stat(path.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0600u);
  EXPECT_EQ(HttpListener::start(settings, echo_length).error().code, ErrorCode::kCannotWrite);  // in use
  listener.reset();
  EXPECT_NE(stat(path.c_str(), &status), 0);
}

TEST(HttpListener, RefusesToListenOpenly) {
  HttpSettings settings = small();
  settings.listen = {"0.0.0.0:0"};
  EXPECT_EQ(HttpListener::start(settings, echo_length).error().code, ErrorCode::kInvalidArgument);
}

TEST(HttpListener, ManyThreadsOfClients) {
  HttpSettings settings = small();
  settings.workers = 4;
  settings.max_connections = 500;  // none is turned out: a closed one may wait a while for its end
  const auto listener = started(settings);
  std::atomic<int> answered{0};
  std::vector<std::jthread> threads;
  for (int t = 0; t < 8; ++t) {
    threads.emplace_back([&] {
      for (int i = 0; i < 50; ++i) {
        Client client(*listener);
        client.say(kRequest);
        answered += client.hear() == "18\n";
      }
    });
  }
  threads.clear();
  EXPECT_EQ(answered, 400);
}

}  // namespace
}  // namespace mapcodec::daemon
