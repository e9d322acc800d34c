// SPDX-License-Identifier: GPL-3.0-or-later
// Runs a fuzz target without libFuzzer: over the seeds given and deterministic mutations of each (cuts,
// flipped bits, overwritten words, inserted and removed runs), so that every build checks what the fuzzers
// check. Usage: fuzz_<name> FOLDER_OR_FILE...   $MAPCODEC_FUZZ_SECONDS: as many mutations as fit into so
// many.
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace {

using Input = std::vector<std::uint8_t>;
constexpr std::size_t kMutationsPerSeed = 400;
constexpr std::chrono::seconds kBudget{
    20};  // for all seeds; a slow machine runs fewer mutations, never other ones

/// 0: the ordinary test.
int asked_seconds() {
  const char* text = std::getenv("MAPCODEC_FUZZ_SECONDS");
  return text == nullptr ? 0 : std::atoi(text);
}

void run(const Input& input) {
  LLVMFuzzerTestOneInput(input.data(), input.size());
}

Input read(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::vector<std::filesystem::path> list(int argc, char** argv) {
  std::vector<std::filesystem::path> files;
  for (int i = 1; i < argc; ++i) {
    std::error_code ignored;
    if (std::filesystem::is_regular_file(argv[i], ignored)) files.emplace_back(argv[i]);
    for (const auto& entry : std::filesystem::directory_iterator(argv[i], ignored))
      files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

/// A position, more often near the start, where headers and counts lie.
std::size_t pick(std::mt19937_64& random, std::size_t size) {
  const std::size_t reach = random() % 2 == 0 ? std::min<std::size_t>(size, 64) : size;
  return random() % reach;
}

void overwrite_word(Input& input, std::mt19937_64& random) {
  constexpr std::uint64_t kWords[] = {
      0, 1, 0x7F, 0xFF, 0x7FFFFFFF, 0xFFFFFFFF, 0x7FF0000000000000u, ~std::uint64_t{0}};
  const std::uint64_t word = kWords[random() % std::size(kWords)];
  const std::size_t at = pick(random, input.size()), width = std::size_t{1} << (random() % 4);
  for (std::size_t i = 0; i < width && at + i < input.size(); ++i) {
    input[at + i] = static_cast<std::uint8_t>(word >> (8 * i));
  }
}

void mutate(Input& input, std::mt19937_64& random) {
  if (input.empty()) return input.push_back(static_cast<std::uint8_t>(random()));
  const std::size_t at = pick(random, input.size());
  const auto here = input.begin() + static_cast<std::ptrdiff_t>(at);
  const auto run_length =
      static_cast<std::ptrdiff_t>(std::min<std::size_t>(1 + random() % 16, input.size() - at));
  switch (random() % 6) {
    case 0:
      input.resize(at);
      break;
    case 1:
      input.erase(here, here + run_length);
      break;
    case 2:
      input.insert(here, static_cast<std::size_t>(run_length), static_cast<std::uint8_t>(random()));
      break;
    case 3:
      overwrite_word(input, random);
      break;
    default:
      *here ^= static_cast<std::uint8_t>(1u << (random() % 8));
  }
}

std::size_t run_mutations(const Input& seed, std::uint64_t number,
                          std::chrono::steady_clock::time_point end) {
  std::mt19937_64 random(number);
  std::size_t done = 0;
  const std::size_t most = asked_seconds() > 0 ? SIZE_MAX : kMutationsPerSeed;
  for (; done < most && std::chrono::steady_clock::now() < end; ++done) {
    Input input = seed;
    for (std::size_t n = 1 + random() % 4; n > 0; --n) mutate(input, random);
    run(input);
  }
  return done;
}

}  // namespace

int main(int argc, char** argv) {
  const auto files = list(argc, argv);
  const auto start = std::chrono::steady_clock::now();
  run({});
  std::size_t runs = 1;
  for (const auto& file : files) run(read(file)), ++runs;
  for (std::size_t i = 0; i < files.size(); ++i) {
    const auto budget = asked_seconds() > 0 ? std::chrono::seconds(asked_seconds()) : kBudget;
    const auto share = budget * static_cast<int>(i + 1) / static_cast<int>(files.size());
    runs += run_mutations(read(files[i]), i + 1, start + share);
  }
  std::printf("%zu seeds, %zu inputs, nothing found\n", files.size(), runs);
  return files.empty() ? 1 : 0;  // a target without a seed tests nothing
}
