#include "protocols/descriptor_set.hpp"

#include <google/protobuf/descriptor.pb.h>

#include "bench.pb.h"

namespace drivebench {

std::string bench_descriptor_set() {
  google::protobuf::FileDescriptorSet set;
  v1::Envelope::descriptor()->file()->CopyTo(set.add_file());
  return set.SerializeAsString();
}

}  // namespace drivebench
