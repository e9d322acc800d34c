// SPDX-License-Identifier: GPL-3.0-or-later
// Kills writers and compactions at random moments, and lets disks run full under them; after each, the last
// committed revision must open, verify, and be complete.
//   kill_many [--count N] [--full N] [--seed S]      N kills and N full disks; default: 25 and 10, or what
//                                                    MAPCODEC_FAULT_KILLS and MAPCODEC_FAULT_FULL say
#include <fcntl.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <thread>

#include "tests/fault/fault_map.hpp"

namespace mapcodec::fault {
namespace {

/// Between the checker and the process that it kills.
struct Shared {
  std::atomic<std::uint64_t> committed{0};  // the last revision whose commit has returned
  std::atomic<std::uint64_t> compactions{0};
  std::atomic<bool> compacting{false};
};

struct Settings {
  std::uint64_t kills = 25, full = 10, seed = 1;
};

struct Tally {
  std::uint64_t during_compaction = 0, unfinished = 0, one_ahead = 0, stopped = 0;
};

/// Updates, compactions, with and without folding, and new beginnings of the writer until it is killed or
/// fails.
/// @return an exit code: 0 only where a write failed.
int work(const std::string& path, Shared& shared, Model model, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  for (bool compact_first = random() % 2 == 0;; compact_first = false) {
    if (!compact_first) {
      auto writer = MapWriter::open(path);
      if (!writer.ok()) return 2;
      if (random() % 2 == 0) writer->store_hashes(true);
      for (std::uint64_t i = 1 + random() % 6; i > 0; --i) {
        const auto steps = steps_of(writer->revision() + 1, model);
        if (!write(*writer, steps).ok()) return 0;
        apply(steps, writer->revision(), model);
        shared.committed = writer->revision();
      }
    }
    CompactSettings settings;
    if (random() % 2 == 0) settings.fold = fold;
    settings.keep_last = 1 + random() % 3;
    shared.compacting = true;
    if (!compact_archive(path, settings).ok()) return 0;
    shared.compacting = false;
    ++shared.compactions;
  }
}

Shared* make_shared_memory() {
  void* memory = ::mmap(nullptr, sizeof(Shared), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  return memory == MAP_FAILED ? nullptr : new (memory) Shared;
}

int fail(const std::string& what) {
  std::fprintf(stderr, "kill_many: %s\n", what.c_str());
  return 1;
}

class Trial {
 public:
  Trial(std::string folder, Shared& shared, const Settings& settings)
      : folder_(std::move(folder)), path_(folder_ + "/map.mapc"), shared_(shared), random_(settings.seed) {}

  /// A first revision. @return "" or what went wrong.
  std::string begin() {
    auto writer = MapWriter::create(path_, map_info(), true);
    if (!writer.ok()) return writer.error().to_string();
    model_.clear();
    const auto steps = steps_of(1, model_);
    if (const Status written = write(*writer, steps); !written.ok()) return written.error().to_string();
    apply(steps, 1, model_);
    revision_ = 1;
    return "";
  }

  std::string kill_once() {
    const pid_t child = start(0);
    std::this_thread::sleep_for(std::chrono::microseconds(random_() % 60000));
    ::kill(child, SIGKILL);
    int status = 0;
    ::waitpid(child, &status, 0);
    if (!WIFSIGNALED(status)) return "the writer ended by itself: " + std::to_string(status);
    tally_.during_compaction += shared_.compacting ? 1 : 0;
    return check_after();
  }

  std::string fill_once() {
    const pid_t child = start(random_() % (std::filesystem::file_size(path_) + 400000));
    int status = 0;
    ::waitpid(child, &status, 0);
    if (!WIFEXITED(status) || WEXITSTATUS(status) != 0)
      return "the writer did not report the full disk: " + std::to_string(status);
    tally_.during_compaction += shared_.compacting ? 1 : 0;
    ++tally_.stopped;
    return check_after();
  }

  [[nodiscard]] const Tally& tally() const { return tally_; }
  [[nodiscard]] std::uint64_t revision() const { return revision_; }

 private:
  /// @param most_bytes  that a file may have; 0: any.
  pid_t start(std::uint64_t most_bytes) {
    shared_.committed = revision_;
    shared_.compacting = false;
    const std::uint64_t seed = random_();
    const pid_t child = ::fork();
    if (child != 0) return child;
    if (most_bytes > 0) {
      ::signal(SIGXFSZ, SIG_IGN);  // an error of write(), not a death
      const rlimit limit{most_bytes, most_bytes};
      ::setrlimit(RLIMIT_FSIZE, &limit);
    }
    ::_exit(work(path_, shared_, model_, seed));
  }

  /// The newest revision is the last committed one, or the one whose commit was about to return.
  std::string check_after() {
    const std::uint64_t committed = shared_.committed;
    const auto archive = MapArchive::open(path_);
    if (!archive.ok()) return "cannot be opened: " + archive.error().to_string();
    if (archive->revision() != committed && archive->revision() != committed + 1)
      return "revision " + std::to_string(committed) + " was committed, the newest is " +
             std::to_string(archive->revision());
    tally_.one_ahead += archive->revision() - committed;
    tally_.unfinished += archive->trailing_bytes() > 0 ? 1 : 0;
    for (; revision_ < archive->revision(); ++revision_)
      apply(steps_of(revision_ + 1, model_), revision_ + 1, model_);
    return check(path_, model_, revision_);
  }

  std::string folder_, path_;
  Shared& shared_;
  std::mt19937_64 random_;
  Model model_;
  std::uint64_t revision_ = 0;
  Tally tally_;
};

std::string leftovers(const std::string& folder) {
  std::string names;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().filename() != "map.mapc") names += " " + entry.path().filename().string();
  }
  return names;
}

int run(const Settings& settings, const std::string& folder) {
  Shared* shared = make_shared_memory();
  if (!shared) return fail("no shared memory");
  Trial trial(folder, *shared, settings);
  if (const std::string wrong = trial.begin(); !wrong.empty()) return fail(wrong);
  for (std::uint64_t i = 0; i < settings.kills; ++i) {
    if (const std::string wrong = trial.kill_once(); !wrong.empty())
      return fail("kill " + std::to_string(i) + ": " + wrong);
  }
  const Tally kills = trial.tally();
  for (std::uint64_t i = 0; i < settings.full; ++i) {
    if (const std::string wrong = trial.fill_once(); !wrong.empty())
      return fail("full disk " + std::to_string(i) + ": " + wrong);
  }
  // What killed compactions left is removed by the next one.
  if (const auto done = compact_archive(folder + "/map.mapc"); !done.ok())
    return fail(done.error().to_string());
  if (const std::string names = leftovers(folder); !names.empty()) return fail("left behind:" + names);
  std::printf(
      "%llu kills (%llu during compaction, %llu left an unfinished tail, %llu just after the commit), "
      "%llu full disks (%llu during compaction); %llu revisions, %llu compactions: nothing was lost\n",
      static_cast<unsigned long long>(settings.kills),
      static_cast<unsigned long long>(kills.during_compaction),
      static_cast<unsigned long long>(kills.unfinished), static_cast<unsigned long long>(kills.one_ahead),
      static_cast<unsigned long long>(settings.full),
      static_cast<unsigned long long>(trial.tally().during_compaction - kills.during_compaction),
      static_cast<unsigned long long>(trial.revision()),
      static_cast<unsigned long long>(shared->compactions.load()));
  return 0;
}

std::uint64_t from_environment(const char* name, std::uint64_t otherwise) {
  const char* text = std::getenv(name);
  return text ? std::strtoull(text, nullptr, 10) : otherwise;
}

}  // namespace
}  // namespace mapcodec::fault

int main(int argc, char** argv) {
  using namespace mapcodec::fault;
  Settings settings;
  settings.kills = from_environment("MAPCODEC_FAULT_KILLS", settings.kills);
  settings.full = from_environment("MAPCODEC_FAULT_FULL", settings.full);
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::uint64_t value = std::strtoull(argv[i + 1], nullptr, 10);
    if (std::strcmp(argv[i], "--count") == 0) settings.kills = value;
    if (std::strcmp(argv[i], "--full") == 0) settings.full = value;
    if (std::strcmp(argv[i], "--seed") == 0) settings.seed = value;
  }
  std::string folder = (std::filesystem::temp_directory_path() / "mapcodec-fault-XXXXXX").string();
  if (!::mkdtemp(folder.data())) return 1;
  const int code = run(settings, folder);
  if (code == 0) std::filesystem::remove_all(folder);  // what failed stays, to be looked at
  return code;
}
