# docker build -t phyblock . && docker run --rm -v "$PWD:/work" phyblock run quick
FROM python:3.13-slim
WORKDIR /opt/phyblock
COPY requirements.lock ./
RUN pip install --no-cache-dir --only-binary :all: --require-hashes --requirement requirements.lock
COPY . ./
RUN pip install --no-cache-dir --no-deps .
WORKDIR /work
ENTRYPOINT ["phyblock"]
CMD ["--help"]
