# diff3ds with all its optional parts and the small network, for CPUs:
#
#     docker build -t diff3ds .
#     docker run --rm -v "$PWD:/sketches" -u "$(id -u):$(id -g)" diff3ds text "a chair" -o chair
#
# With PyTorch for NVIDIA GPUs, which is some 4 GB larger, and the renderer's kernels for them:
#
#     docker build -t diff3ds:cuda --build-arg TORCH_INDEX=https://pypi.org/simple --build-arg EXTRAS=all,cuda .
#     docker run --rm --gpus all -v "$PWD:/sketches" -u "$(id -u):$(id -g)" diff3ds:cuda doctor
FROM python:3.13-slim AS build

# Whatever compiler the image's own release has: any of them builds the kernels.
# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install -y --no-install-recommends g++ \
    && rm -rf /var/lib/apt/lists/*
WORKDIR /source
COPY CMakeLists.txt pyproject.toml LICENSE README.md CHANGELOG.md CITATION.cff ./
COPY csrc csrc
COPY networks networks
COPY src src
RUN pip wheel --no-cache-dir --no-deps -w /wheels . ./networks

FROM python:3.13-slim

# PyTorch's own index has the build without CUDA.
ARG TORCH_INDEX=https://download.pytorch.org/whl/cpu
ARG EXTRAS=all
COPY --from=build /wheels /wheels
COPY constraints-cpu.txt /wheels/
# The image stays as it was tried: without kernels for CPUs it would be a hundred times slower, and is refused.
RUN pip install --no-cache-dir -c /wheels/constraints-cpu.txt --index-url "$TORCH_INDEX" torch \
    && wheel="$(ls /wheels/diff3ds-*.whl)" \
    && pip install --no-cache-dir -c /wheels/constraints-cpu.txt "${wheel}[${EXTRAS}]" /wheels/diff3ds_networks-*.whl \
    && python -c "import diff3ds; assert 'cpu' in diff3ds.available_backends(), 'the kernels did not build'"

# Nothing needs more rights than those of a user; caches of any user go where all may write.
USER 1000
ENV HOME=/tmp HF_HOME=/sketches/.cache/huggingface
WORKDIR /sketches
ENTRYPOINT ["diff3ds"]
CMD ["--help"]
