// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/mapcodecd/operations/metrics.hpp"

#include <prometheus/counter.h>
#include <prometheus/histogram.h>
#include <prometheus/registry.h>
#include <prometheus/text_serializer.h>

#include <array>

#include "tools/mapcodecd/operations/process_figures.hpp"

namespace mapcodec::daemon {
namespace {

using Labels = std::map<std::string, std::string>;
using CounterFamily = prometheus::Family<prometheus::Counter>;
using HistogramFamily = prometheus::Family<prometheus::Histogram>;
constexpr std::size_t kMostMaps = 1000;

const prometheus::Histogram::BucketBoundaries kRequestSeconds{0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.05,
                                                              0.1,    0.25,  0.5,    1,     2.5,  5,     10};
const prometheus::Histogram::BucketBoundaries kCommitSeconds{0.005, 0.01, 0.025, 0.05, 0.1, 0.25,
                                                             0.5,   1,    2.5,   5,    10};
const prometheus::Histogram::BucketBoundaries kCommitScans{1, 2, 5, 10, 20, 50, 100, 200, 500};

/// Name, help and label of each counter, in the order of ServiceMetrics::Counter.
struct CounterName {
  const char *name, *help, *label, *value;
};
constexpr std::array<CounterName, ServiceMetrics::kCounters> kCounterNames{{
    {"mapcodec_bytes_total", "Payload of requests and answers.", "direction", "in"},
    {"mapcodec_bytes_total", "Payload of requests and answers.", "direction", "out"},
    {"mapcodec_points_in_total", "Finite points of scans that were committed.", "", ""},
    {"mapcodec_scans_in_total", "Scans that were committed.", "", ""},
    {"mapcodec_tiles_total", "Tiles that were asked for.", "outcome", "sent"},
    {"mapcodec_tiles_total", "Tiles that were asked for.", "outcome", "not_modified"},
    {"mapcodec_commits_total", "Commits.", "outcome", "done"},
    {"mapcodec_commits_total", "Commits.", "outcome", "failed"},
    {"mapcodec_busy_total", "Requests refused because a queue was full.", "", ""},
    {"mapcodec_compactions_total", "Compactions.", "outcome", "done"},
    {"mapcodec_compactions_total", "Compactions.", "outcome", "stopped"},
    {"mapcodec_compactions_total", "Compactions.", "outcome", "failed"},
}};

/// The codes of success: of gRPC, and of HTTP below 400.
bool is_error(std::string_view code) {
  return code != "OK" && code != "ok" && (code.empty() || code[0] >= '4');
}

using Families = std::vector<prometheus::MetricFamily>;

void add_gauge(Families& families, const GaugeSample& sample) {
  prometheus::MetricFamily family;
  family.name = sample.name;
  family.help = sample.help;
  family.type = sample.counter ? prometheus::MetricType::Counter : prometheus::MetricType::Gauge;
  prometheus::ClientMetric metric;
  (sample.counter ? metric.counter.value : metric.gauge.value) = sample.value;
  family.metric.push_back(std::move(metric));
  families.push_back(std::move(family));
}

void add_service(Families& families, const ServiceStats& s) {
  const auto number = [](auto value) { return static_cast<double>(value); };
  for (const GaugeSample& sample : {
           GaugeSample{"mapcodec_maps", "Maps in the folder.", number(s.maps)},
           GaugeSample{"mapcodec_editors", "Maps that are open for writing.", number(s.editors)},
           GaugeSample{"mapcodec_queue_scans", "Scans that wait for a commit.", number(s.queued_scans)},
           GaugeSample{"mapcodec_queue_points", "Points that wait for a commit.", number(s.queued_points)},
           GaugeSample{"mapcodec_queue_limit_points", "Points that may wait.", number(s.queue_limit_points)},
           GaugeSample{"mapcodec_cache_bytes", "Tiles held in memory.", number(s.cache_bytes)},
           GaugeSample{"mapcodec_cache_limit_bytes", "Tiles that may be held in memory.",
                       number(s.cache_limit_bytes)},
           GaugeSample{"mapcodec_cache_hits_total", "Segments found in memory.", number(s.cache_hits), true},
           GaugeSample{"mapcodec_cache_misses_total", "Segments read from disk.", number(s.cache_misses),
                       true},
           GaugeSample{"mapcodec_watchers", "Clients that wait for changes.", number(s.watchers)},
           GaugeSample{"mapcodec_compacting", "Compactions at work.", number(s.compacting)},
           GaugeSample{"mapcodec_draining", "1 once the daemon was told to end.", s.draining ? 1.0 : 0.0},
       }) {
    add_gauge(families, sample);
  }
}

void add_map_family(Families& families, const char* name, const char* help, const std::vector<MapEntry>& maps,
                    double (*value)(const MapEntry&)) {
  prometheus::MetricFamily family;
  family.name = name;
  family.help = help;
  family.type = prometheus::MetricType::Gauge;
  for (const MapEntry& map : maps) {
    prometheus::ClientMetric metric;
    metric.label.push_back({"map", map.name});
    metric.gauge.value = value(map);
    family.metric.push_back(std::move(metric));
  }
  families.push_back(std::move(family));
}

void add_maps(Families& families, const std::vector<MapEntry>& maps) {
  if (maps.size() > kMostMaps) return;
  add_map_family(families, "mapcodec_map_revision", "Newest revision.", maps,
                 [](const MapEntry& m) { return static_cast<double>(m.revision); });
  add_map_family(families, "mapcodec_map_tiles", "Tiles of the newest revision.", maps,
                 [](const MapEntry& m) { return static_cast<double>(m.tiles); });
  add_map_family(families, "mapcodec_map_points", "Points of the newest revision.", maps,
                 [](const MapEntry& m) { return static_cast<double>(m.points); });
  add_map_family(families, "mapcodec_map_bytes", "Size of the archive.", maps,
                 [](const MapEntry& m) { return static_cast<double>(m.bytes); });
  add_map_family(families, "mapcodec_map_fault", "1 if the archive cannot be opened.", maps,
                 [](const MapEntry& m) { return m.fault.empty() ? 0.0 : 1.0; });
}

}  // namespace

struct PrometheusMetrics::Impl {
  prometheus::Registry registry;
  CounterFamily& requests = prometheus::BuildCounter()
                                .Name("mapcodec_requests_total")
                                .Help("Requests that have ended.")
                                .Register(registry);
  CounterFamily& errors = prometheus::BuildCounter()
                              .Name("mapcodec_errors_total")
                              .Help("Requests that ended in an error.")
                              .Register(registry);
  HistogramFamily& seconds = prometheus::BuildHistogram()
                                 .Name("mapcodec_request_seconds")
                                 .Help("Time from a request to the end of its answer.")
                                 .Register(registry);
  prometheus::Histogram& commit_seconds = prometheus::BuildHistogram()
                                              .Name("mapcodec_commit_seconds")
                                              .Help("Time of a commit.")
                                              .Register(registry)
                                              .Add({}, kCommitSeconds);
  prometheus::Histogram& commit_scans = prometheus::BuildHistogram()
                                            .Name("mapcodec_commit_scans")
                                            .Help("Scans that shared a commit.")
                                            .Register(registry)
                                            .Add({}, kCommitScans);
  std::array<prometheus::Counter*, kCounters> counters{};

  Impl() {
    for (std::size_t i = 0; i < kCounters; ++i) {
      const CounterName& c = kCounterNames[i];
      auto& family = prometheus::BuildCounter().Name(c.name).Help(c.help).Register(registry);
      counters[i] = &family.Add(*c.label == 0 ? Labels{} : Labels{{c.label, c.value}});
    }
  }
};

PrometheusMetrics::PrometheusMetrics() : impl_(std::make_unique<Impl>()) {}
PrometheusMetrics::~PrometheusMetrics() = default;

void PrometheusMetrics::add(Counter counter, double amount) {
  impl_->counters[static_cast<std::size_t>(counter)]->Increment(amount);
}

void PrometheusMetrics::request(std::string_view transport, std::string_view method, std::string_view code,
                                double seconds) {
  const std::string t(transport), m(method), c(code);
  impl_->requests.Add({{"transport", t}, {"method", m}, {"code", c}}).Increment();
  if (is_error(code)) impl_->errors.Add({{"transport", t}, {"code", c}}).Increment();
  impl_->seconds.Add({{"transport", t}, {"method", m}}, kRequestSeconds).Observe(seconds);
}

void PrometheusMetrics::commit(double seconds, std::uint64_t scans) {
  impl_->commit_seconds.Observe(seconds);
  impl_->commit_scans.Observe(static_cast<double>(scans));
}

std::string PrometheusMetrics::text(const MapService* service, const std::vector<GaugeSample>& more) const {
  Families families = impl_->registry.Collect();
  if (service != nullptr) {
    add_service(families, service->stats());
    add_maps(families, service->list());
  }
  for (const GaugeSample& sample : process_figures()) add_gauge(families, sample);
  for (const GaugeSample& sample : more) add_gauge(families, sample);
  return prometheus::TextSerializer().Serialize(families);
}

}  // namespace mapcodec::daemon
