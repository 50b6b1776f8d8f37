// Asks the ONNX file of a field along rays, in C++: `ddf export rabbit field.onnx`, with onnxruntime's headers,
//   g++ -std=c++17 rays_in_cpp.cpp -o rays -l:libonnxruntime.so.1 && ./rays field.onnx 0 0 1 0 0 -1
// The numbers are a start in the box and a direction of length 1 in the frame of the field: docs/onnx.md.
#include <onnxruntime_c_api.h>

#include <cstdio>
#include <cstdlib>
#include <vector>

static const OrtApi* ort = nullptr;

static void check(OrtStatus* status) {
  if (!status) return;
  std::fprintf(stderr, "%s\n", ort->GetErrorMessage(status));
  std::exit(1);
}

int main(int count, char** words) {
  if (count < 8 || (count - 2) % 6) return std::fprintf(stderr, "usage: rays FIELD.onnx px py pz vx vy vz ...\n"), 2;
  if (!(ort = OrtGetApiBase()->GetApi(ORT_API_VERSION))) return std::fprintf(stderr, "onnxruntime is older\n"), 1;
  const int64_t rays = (count - 2) / 6, shape[] = {rays, 3};
  std::vector<float> rows[2];
  for (int64_t i = 0; i < 6 * rays; ++i) rows[i % 6 / 3].push_back(std::strtof(words[2 + i], nullptr));

  OrtEnv* environment;
  OrtSessionOptions* options;
  OrtSession* session;
  OrtMemoryInfo* memory;
  check(ort->CreateEnv(ORT_LOGGING_LEVEL_WARNING, "rays", &environment));
  check(ort->CreateSessionOptions(&options));
  check(ort->CreateSession(environment, words[1], options, &session));
  check(ort->CreateCpuMemoryInfo(OrtArenaAllocator, OrtMemTypeDefault, &memory));

  const char* names[] = {"positions", "directions"};
  const char* asked[] = {"visibility", "depth"};
  OrtValue *given[2], *found[2] = {nullptr, nullptr};
  for (int i = 0; i < 2; ++i)
    check(ort->CreateTensorWithDataAsOrtValue(memory, rows[i].data(), rows[i].size() * sizeof(float), shape, 2,
                                              ONNX_TENSOR_ELEMENT_DATA_TYPE_FLOAT, &given[i]));
  check(ort->Run(session, nullptr, names, given, 2, asked, 2, found));
  float* values[2];
  for (int i = 0; i < 2; ++i) check(ort->GetTensorMutableData(found[i], reinterpret_cast<void**>(&values[i])));
  for (int64_t i = 0; i < rays; ++i) std::printf("visibility %.4f depth %.4f\n", values[0][i], values[1][i]);
}
