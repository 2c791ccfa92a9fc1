#include "ros/stream_merger.h"

#include <gtest/gtest.h>

namespace scanner::bridge {
namespace {

Time at(double seconds) { return Time() + fromSeconds(100.0 + seconds); }

ImuSample sample(double seconds) {
  ImuSample s;
  s.stamp = at(seconds);
  return s;
}

/// Writes down what comes, "i" for a sample and "F" for a frame.
struct Recorder {
  std::string order;
  std::vector<Time> frames;
  BagHandlers handlers() {
    BagHandlers h;
    h.imu = [this](const ImuSample&) { return order += 'i', true; };
    h.frame = [this](const StereoFrame& frame) {
      order += 'F';
      frames.push_back(frame.stamp);
      return true;
    };
    return h;
  }
};

TEST(StreamMerger, SamplesUpToAndOnePastAFrameComeBeforeIt) {
  Recorder recorder;
  StreamMerger merger(recorder.handlers(), fromSeconds(2.0));
  // The frame arrives before its samples in the file.
  merger.addLeft(at(0.105), {});
  merger.addRight(at(0.105), {});
  for (int i = 0; i < 13; ++i) merger.addImu(sample(0.01 * i));
  merger.finish();
  EXPECT_EQ(recorder.order, "iiiiiiiiiiiiFi");  // 0.00 .. 0.11, then the frame, then 0.12
}

TEST(StreamMerger, ASampleAtTheSameStampIsEnough) {
  Recorder recorder;
  StreamMerger merger(recorder.handlers(), fromSeconds(2.0));
  for (int i = 0; i < 4; ++i) merger.addImu(sample(i));
  merger.addLeft(at(1.0), {});
  merger.addRight(at(1.0), {});
  merger.finish();
  EXPECT_EQ(recorder.order.substr(0, 3), "iiF");
}

TEST(StreamMerger, FramesDoNotWaitForSamplesThatPause) {
  Recorder recorder;
  StreamMerger merger(recorder.handlers(), fromSeconds(2.0));
  merger.addImu(sample(0.0));
  for (int i = 1; i < 10; ++i) {
    merger.addLeft(at(i), {});
    merger.addRight(at(i), {});
  }
  EXPECT_EQ(recorder.frames.size(), 7U);  // all but those inside the window
  merger.finish();
  EXPECT_EQ(recorder.frames.size(), 9U);
}

TEST(StreamMerger, ImagesWithoutAPartnerAreNamed) {
  Recorder recorder;
  StreamMerger merger(recorder.handlers(), fromSeconds(2.0));
  merger.addLeft(at(1.0), {});
  merger.addLeft(at(2.0), {});
  merger.addRight(at(2.0), {});
  merger.addRight(at(3.000001), {});
  merger.addLeft(at(3.0), {});
  merger.finish();
  EXPECT_EQ(recorder.frames, std::vector<Time>{at(2.0)});
  EXPECT_EQ(merger.unpairedLeft(), (std::vector<Time>{at(1.0), at(3.0)}));
  EXPECT_EQ(merger.unpairedRight(), std::vector<Time>{at(3.000001)});
}

TEST(StreamMerger, StopsWhenAHandlerAsks) {
  BagHandlers handlers;
  int seen = 0;
  handlers.imu = [&](const ImuSample&) { return ++seen < 3; };
  StreamMerger merger(handlers, fromSeconds(0.0));
  EXPECT_TRUE(merger.addImu(sample(0.0)));
  EXPECT_TRUE(merger.addImu(sample(1.0)));
  EXPECT_FALSE(merger.addImu(sample(2.0)));
  EXPECT_EQ(seen, 3);
}

TEST(StampTracker, CountsGapsRatesAndBackwardStamps) {
  StampTracker tracker;
  for (int i = 0; i < 10; ++i) {
    EXPECT_TRUE(tracker.accept(at(0.1 * i), at(0.1 * i + 0.02)));
  }
  EXPECT_TRUE(tracker.accept(at(2.0), at(2.5)));
  EXPECT_FALSE(tracker.accept(at(2.0), at(2.6)));
  EXPECT_FALSE(tracker.accept(at(1.0), at(2.7)));
  const TopicStatistics s = tracker.statistics("/t", 4);
  EXPECT_EQ(s.messages, 17U);
  EXPECT_EQ(s.backward, 2U);
  EXPECT_EQ(s.unusable, 4U);
  EXPECT_EQ(s.gaps, 1U);
  EXPECT_NEAR(s.rate_hz, 10.0, 1e-6);
  EXPECT_NEAR(s.longest_gap_s, 1.1, 1e-9);
  EXPECT_NEAR(s.max_delay_s, 0.5, 1e-9);
}

}  // namespace
}  // namespace scanner::bridge
