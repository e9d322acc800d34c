// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/mapcodecd/http/connection_table.hpp"

#include <algorithm>

namespace mapcodec::daemon {

void ConnectionTable::add(std::unique_ptr<Connection> connection) {
  const int fd = connection->fd();
  const std::lock_guard lock(mutex_);
  entries_.insert_or_assign(fd, Entry{std::move(connection), true, std::chrono::steady_clock::now()});
}

std::unique_ptr<Connection> ConnectionTable::queue(int fd, std::size_t most) {
  std::unique_ptr<Connection> refused;
  const std::lock_guard lock(mutex_);
  const auto found = entries_.find(fd);
  if (closed_ || found == entries_.end() || !found->second.resting) return refused;
  if (waiting_.size() >= most) {
    refused = std::move(found->second.connection);
    entries_.erase(found);
    return refused;
  }
  found->second.resting = false;
  waiting_.push_back(found->second.connection.get());
  has_work_.notify_one();
  return refused;
}

Connection* ConnectionTable::next() {
  std::unique_lock lock(mutex_);
  has_work_.wait(lock, [this] { return closed_ || !waiting_.empty(); });
  if (closed_) return nullptr;
  Connection* connection = waiting_.front();
  waiting_.pop_front();
  ++working_;
  return connection;
}

void ConnectionTable::rest(Connection& connection, const std::function<void(int fd)>& wait) {
  const std::lock_guard lock(mutex_);
  Entry& entry = entries_.at(connection.fd());
  entry.resting = true;
  entry.since = std::chrono::steady_clock::now();
  --working_;
  wait(connection.fd());
}

void ConnectionTable::end(Connection& connection) {
  std::unique_ptr<Connection> ended;  // closes its socket after the lock: only then the number is used again
  const std::lock_guard lock(mutex_);
  const auto found = entries_.find(connection.fd());
  ended = std::move(found->second.connection);
  entries_.erase(found);
  --working_;
}

std::size_t ConnectionTable::end_late(SteadyTime now) {
  std::vector<std::unique_ptr<Connection>> ended;
  const std::lock_guard lock(mutex_);
  for (auto at = entries_.begin(); at != entries_.end();) {
    if (at->second.resting && at->second.connection->deadline() <= now) {
      ended.push_back(std::move(at->second.connection));
      at = entries_.erase(at);
    } else {
      ++at;
    }
  }
  return ended.size();
}

bool ConnectionTable::end_longest_resting() {
  std::unique_ptr<Connection> ended;
  const std::lock_guard lock(mutex_);
  auto longest = entries_.end();
  for (auto at = entries_.begin(); at != entries_.end(); ++at) {
    if (at->second.resting && (longest == entries_.end() || at->second.since < longest->second.since))
      longest = at;
  }
  if (longest == entries_.end()) return false;
  ended = std::move(longest->second.connection);
  entries_.erase(longest);
  return true;
}

void ConnectionTable::close() {
  const std::lock_guard lock(mutex_);
  closed_ = true;
  // Those that wait are given up too: no worker will come for them.
  for (Connection* connection : waiting_) entries_.erase(connection->fd());
  waiting_.clear();
  std::erase_if(entries_, [](const auto& entry) { return entry.second.resting; });
  has_work_.notify_all();
}

void ConnectionTable::cut() {
  const std::lock_guard lock(mutex_);
  for (auto& [fd, entry] : entries_) entry.connection->cut();
}

ConnectionTable::Counts ConnectionTable::counts() const {
  const std::lock_guard lock(mutex_);
  return {entries_.size(), waiting_.size(), working_};
}

}  // namespace mapcodec::daemon
