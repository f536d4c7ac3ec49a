# The command `eidrive` for machines without Python 3.11: docker run --rm eidrive run coop/scenario_1
#
#     docker build -t eidrive .
#     docker run --rm -v "$PWD:/work" eidrive run my_scenario.xosc --out runs
FROM python:3.11-slim
# numba and matplotlib use caches only where they may write; the container may run as any user.
ENV NUMBA_CACHE_DIR=/var/cache/numba MPLCONFIGDIR=/tmp/matplotlib
COPY . /src
RUN pip install --no-cache-dir -c /src/constraints.txt "/src[onnx,export,tables]" && rm -rf /src \
    && python -m eidrive_scenario.cli.compile_kernels && chmod -R a+rwX "$NUMBA_CACHE_DIR"
WORKDIR /work
ENTRYPOINT ["eidrive"]
CMD ["--help"]
