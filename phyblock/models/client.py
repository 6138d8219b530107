"""Parts of both clients: keys, one HTTP client with bounds, the reply in an answer, or its error.

No redirect is followed: keys and prompts go only to the named host. A body is read up to a limit.
The time limit applies to the whole exchange, whatever a server does. Nothing is sent twice.
"""

from __future__ import annotations

import base64
import email.utils
import functools
import html
import json
import math
import os
import re
import time
import urllib.parse
import urllib.request
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from phyblock import errors
from phyblock.config.models import ADDRESS_ALLOWED, ModelConfig, host_of, is_address
from phyblock.files import load_json
from phyblock.models.request import Request, json_body, wire_params
from phyblock.records.record import Reply, Usage
from phyblock.text import well_formed
from phyblock.types import Finish

if TYPE_CHECKING:
    import aiohttp

OPENAI_API_BASE = "https://api.openai.com/v1"

_KEY_VARIABLES: Mapping[str, tuple[str, ...]] = {
    "cloudflare": ("CLOUDFLARE_API_KEY",),
    "fireworks_ai": ("FIREWORKS_AI_API_KEY", "FIREWORKS_API_KEY"),
    "gemini": ("GEMINI_API_KEY", "GOOGLE_API_KEY"),
    "perplexity": ("PERPLEXITYAI_API_KEY", "PERPLEXITY_API_KEY"),
    "qwencloud": ("QWENCLOUD_API_KEY", "DASHSCOPE_API_KEY"),
    "together_ai": ("TOGETHERAI_API_KEY", "TOGETHER_API_KEY", "TOGETHER_AI_API_KEY"),
}
"""Variables of providers whose key is not in `<PROVIDER>_API_KEY`, in the order of lookup."""

_ADDRESS_VARIABLES: Mapping[str, tuple[str, ...]] = {
    "anthropic": ("ANTHROPIC_API_BASE", "ANTHROPIC_BASE_URL"),
    "fireworks_ai": ("FIREWORKS_API_BASE",),
    "mistral": ("MISTRAL_AZURE_API_BASE", "MISTRAL_API_BASE"),
    "ollama_chat": ("OLLAMA_API_BASE",),
    "openai": ("OPENAI_BASE_URL", "OPENAI_API_BASE"),
}
"""Variables of a server's address, if not `<PROVIDER>_API_BASE`, in litellm's order."""

_OWN_CREDENTIALS = (
    "azure", "bedrock", "github_copilot", "oci", "sagemaker", "vertex_ai", "watsonx",
)  # fmt: skip
"""Providers that can sign in without an API key, which litellm handles by itself."""

KEYLESS = ("hosted_vllm", "lm_studio", "llamafile", "ollama", "ollama_chat")
"""Local servers, which accept a key but need none."""

_PLACEHOLDER = "no-key"
_PLACEHOLDERS = (_PLACEHOLDER, "empty", "none", "null", "dummy", "test")
"""Placeholders for an unneeded key, in lower case; they are not secrets."""

_CALLED_SECRET = re.compile(
    r"(?:^|_|API)(?:KEY|TOKEN|SECRET|PASSW(?:OR)?D|CREDENTIALS?|JWT)(?:_|$)", re.IGNORECASE
)
_SHORTEST_KEY = 4
_SHORT = 8
_MASK = "[key]"
_LOOKS_SECRET = re.compile(
    r"(?:\bsk-[\w-]{6,}|\bAIza[\w-]{10,}|(?<=Bearer )[\w.~+/-]{6,}|(?<=Basic )[\w+/=-]{6,}"
    r"|(?<=[?&]key=)[^&\s'\"]+|(?<=://)[^/\s@]+(?=@))"
)

_LONGEST_CONNECT_S = 30.0
_LONGEST_MESSAGE = 500
_LONGEST_WORDS = 20_000
"""Characters of a server's message that are examined; far fewer are shown."""

_RETRYABLE = (408, 409, 425, 429)
_UNAVAILABLE = (401, 402, 403, 404)
_PASSING = re.compile(r"429|5\d\d")
_POLICY = re.compile(
    r"content_policy_violation|ResponsibleAIPolicyViolation|content management policy"
    r"|data_?inspection_?failed|\bcontent_filter\b|requires moderation"
    r"|invalid_request_error.*content_policy|safety system",
    re.IGNORECASE,
)
_NEVER = re.compile(
    r"insufficient_quota|billing_hard_limit_reached|model_not_found|invalid_api_key"
    r"|authentication_error|credit balance is too low|API_KEY_INVALID|API key not valid"
    r"|LLM Provider NOT provided|Server is pinned to|Unexpected fields in the request",
    re.IGNORECASE,
)
_MOST_TOKENS = 10**7
"""As many as the longest existing context."""

_FINISH: Mapping[str, Finish] = {
    **dict.fromkeys(("stop", "end_turn", "stop_sequence", "eos", "eos_token"), "stop"),
    **dict.fromkeys(("length", "max_tokens", "model_context_window_exceeded"), "length"),
    **dict.fromkeys(("content_filter", "content_filtered", "refusal", "safety"), "refusal"),
    **dict.fromkeys(("recitation", "blocklist", "prohibited_content"), "refusal"),
    **dict.fromkeys(("spii", "image_safety"), "refusal"),
}
"""Providers' words for the end of a reply, in lower case."""
_THINKING = re.compile(r"\s*<(think|thinking)>(.*?)</\1>\s*(.*)", re.DOTALL)


@dataclass(frozen=True)
class KeyStatus:
    """A model's key: the `variables` checked, in order, the first `key`, and if calls need it."""

    variables: tuple[str, ...]
    key: str | None = field(repr=False)
    is_needed: bool


def api_key_status(config: ModelConfig) -> KeyStatus:
    """Return the state of the model's key in the environment."""
    if config.kind != "litellm":
        return KeyStatus((), None, is_needed=False)
    usual = f"{config.provider.upper().replace('-', '_')}_API_KEY"
    variables = _KEY_VARIABLES.get(config.provider, (usual,))
    if config.api_key_env is not None:
        variables = (config.api_key_env,)
    keys = (os.environ.get(name, "").strip() for name in variables)
    is_needed = config.api_key_env is not None or not (
        config.addresses or config.provider in KEYLESS + _OWN_CREDENTIALS
    )
    return KeyStatus(variables, next(filter(None, keys), None), is_needed)


def api_key(config: ModelConfig) -> str | None:
    """Return the key to send; None leaves it to litellm (providers with their own credentials).

    A server named by `api_base` gets a placeholder if no key is set, since clients require one.
    Raises UnavailableError if a key is needed and not set, or no header can carry it.
    """
    status = api_key_status(config)
    names = " or ".join(status.variables)
    if status.key is not None:
        if not all(" " <= character <= "~" for character in status.key):
            why = f"{names} holds a line break or another character that no header can carry"
            raise errors.UnavailableError(why, sent="no")
        return status.key
    if status.is_needed:
        why = f"no API key for {config.name}: set {names} in the environment"
        raise errors.UnavailableError(why, sent="no")
    return None if config.provider in _OWN_CREDENTIALS else _PLACEHOLDER


def server_address(model_id: str) -> str | None:
    """Return the address of the model's server in the environment, or None.

    litellm would find it too, but then replies of two servers could be confused. Raises SpecError
    if it is not an address, or may contain a key or a password, since it is stored and shown.
    """
    provider = model_id.partition("/")[0]
    usual = f"{provider.upper().replace('-', '_')}_API_BASE"
    for name in _ADDRESS_VARIABLES.get(provider, (usual,)):
        if value := os.environ.get(name):
            if not is_address(value):
                message = "is not an address that can be used"
                where = f"environment variable {name}"
                raise errors.SpecError(errors.Problem(where, message, allowed=ADDRESS_ALLOWED))
            return value
    return None


def secrets_of(config: ModelConfig) -> tuple[str, ...]:
    """Return the values that no stored text may contain, longest first.

    They are the model's key and environment variables named as a key, token, secret, password or
    credential, since litellm signs in with many. Values of fewer than 4 characters (8 if not the
    model's key) and common words for "no key" are excluded: removing them would ruin texts.
    """
    own = api_key_status(config).variables
    secrets = {
        value.strip()
        for name, value in os.environ.items()
        if (name in own and len(value.strip()) >= _SHORTEST_KEY)
        or (_CALLED_SECRET.search(name) and len(value.strip()) >= _SHORT)
    }
    secrets = {value for value in secrets if value.lower() not in _PLACEHOLDERS}
    return tuple(sorted(secrets, key=lambda value: (-len(value), value)))


def hidden(text: str, secrets: Iterable[str], *, guess: bool = True) -> str:
    """Return `text` with every secret masked, whether plain or escaped (JSON, HTML, URL, base64).

    A secret of fewer than 8 characters is masked only as a whole word: inside a longer word it is a
    coincidence. With `guess`, for messages and not for replies, text that looks like a key is also
    masked, and the beginning of a secret at the very end of the text, where it was cut.
    """
    known = tuple(secrets)
    for form in _forms(known):
        if form in text:
            exact = re.escape(form)
            word = rf"(?<![^\W_]){exact}(?![^\W_])" if len(form) < _SHORT else exact
            text = re.sub(word, _MASK, text)
    if not guess:
        return text
    for form in _forms(known):
        for length in range(len(form) - 1, _SHORTEST_KEY - 1, -1):
            if text.endswith(form[:length]):
                text = text[:-length] + _MASK
                break
    return _LOOKS_SECRET.sub(_MASK, text)


@functools.lru_cache(maxsize=64)
def _forms(secrets: tuple[str, ...]) -> tuple[str, ...]:
    """Return all forms in which a server, a library or a log may write one of the secrets.

    The longest come first, since one may begin another. In base64 a secret is found anywhere in the
    encoded bytes, also in `user:key`; characters that also depend on neighbors are omitted.
    """
    forms: set[str] = set()
    for secret in secrets:
        quoted, escaped = urllib.parse.quote(secret, safe=""), json.dumps(secret)[1:-1]
        forms |= {secret, " ".join(secret.split()), repr(secret)[1:-1], html.escape(secret)}
        forms |= {escaped, escaped.replace("/", "\\/"), secret.replace("'", "\\'")}
        forms |= {quoted, urllib.parse.quote(secret), urllib.parse.quote_plus(secret)}
        forms.add(re.sub("%..", lambda match: match[0].lower(), quoted))
        for before in range(3):
            data = bytes(before) + secret.encode()
            inside = slice((before * 8 + 5) // 6, len(data) * 8 // 6)
            for encode in (base64.b64encode, base64.urlsafe_b64encode):
                encoded = encode(data).decode()[inside]
                forms |= {encoded} if len(encoded) >= _SHORT else set()
    return tuple(sorted(forms, key=lambda form: (-len(form), form)))


class Client(ABC):
    """Sends a request to one server, once: retries, limits and the cache are above.

    Neither its replies nor its errors contain a key. An error other than ModelError is a bug in
    phyblock, or an input that cannot be sent, and ends the run.
    """

    def __init__(self, config: ModelConfig, http: HttpClient | None = None) -> None:
        """`http` sends instead of a new connection."""
        self.config = config
        self.http = http or HttpClient(config.timeout_s)
        self._secrets = secrets_of(config)

    async def complete(self, request: Request) -> Reply:
        """Return the validated reply, without its cost; raises ModelError."""
        seed = request.seed if self.takes_seed else None
        started_s = time.perf_counter()
        try:
            reply = await self._complete(request, seed)
        except errors.ModelError as error:
            error.args = (shown(str(error), self._secrets),)
            raise
        texts = {
            name: hidden(text, self._secrets, guess=False)
            for name in ("text", "reasoning", "provider_model")
            if (text := getattr(reply, name))
        }
        known = {"latency_s": time.perf_counter() - started_s, "seed_sent": seed is not None}
        return reply.model_copy(update={**texts, **known})

    @property
    def takes_seed(self) -> bool:
        """True if seeds are sent."""
        return self.config.seed != "never"

    @abstractmethod
    async def _complete(self, request: Request, seed: int | None) -> Reply:
        """Send once; the result may contain keys."""

    async def aclose(self) -> None:
        """Close all connections."""
        await self.http.aclose()


def shown(text: str, secrets: tuple[str, ...]) -> str:
    """Return a text for messages and records: keys are removed before it is cut."""
    return " ".join(hidden(text, secrets).split())[:_LONGEST_MESSAGE]


LARGEST_REPLY_BYTES = 32 * 1024 * 1024
"""Default limit of a reply's body [bytes]: a hundred times the longest reasoning."""


@dataclass(frozen=True)
class Answer:
    """A server's answer; `fault` is the problem of its body, or ""."""

    status: int
    headers: Mapping[str, str]
    body: bytes
    fault: str = ""

    @property
    def is_success(self) -> bool:
        """True if the status indicates a reply."""
        return 200 <= self.status < 300


def _proxy_for(url: str) -> str | None:
    """Return the proxy that the environment sets for an address."""
    parts, proxies = urllib.parse.urlsplit(url), urllib.request.getproxies()
    proxy = proxies.get(parts.scheme) or proxies.get("all")
    if not proxy or urllib.request.proxy_bypass(parts.hostname or ""):
        return None
    return proxy if "://" in proxy else f"http://{proxy}"


class HttpClient:
    """Sends requests for one model over one session, which the first request opens."""

    def __init__(self, timeout_s: float, most_bytes: int | None = None) -> None:
        self._timeout_s = timeout_s
        self._most_bytes = most_bytes or LARGEST_REPLY_BYTES
        self._session: aiohttp.ClientSession | None = None
        self._proxy_for = functools.cache(_proxy_for)

    async def send(
        self, url: str, body: bytes, headers: Mapping[str, str], *, method: str = "POST"
    ) -> Answer:
        """Send once and read the answer.

        Raises RetryableError if the connection failed or was lost, or the answer ended too late.
        """
        import aiohttp
        import yarl

        if self._session is None:
            connect_s = min(_LONGEST_CONNECT_S, self._timeout_s / 2)
            self._session = aiohttp.ClientSession(
                connector=aiohttp.TCPConnector(limit=0),
                timeout=aiohttp.ClientTimeout(total=self._timeout_s, connect=connect_s),
                cookie_jar=aiohttp.DummyCookieJar(),
            )
        host = host_of(url)
        try:
            async with self._session.request(
                method,
                yarl.URL(url, encoded=url.isascii()),
                data=body,
                headers={**headers, "Accept-Encoding": "gzip, deflate"},
                proxy=self._proxy_for(url),
                allow_redirects=False,
            ) as response:
                content, fault = await self._read(response)
                if fault:
                    response.close()
                return Answer(response.status, response.headers, content, fault)
        except (aiohttp.ConnectionTimeoutError, aiohttp.ClientConnectorError) as error:
            host = error.host if isinstance(error, aiohttp.ClientProxyConnectionError) else host
            said = f"no connection to {host}: {getattr(error, 'os_error', error)}"
            raise errors.RetryableError(said, sent="no") from None
        except TimeoutError:
            within = f"no whole answer within {self._timeout_s:g} s"
            raise errors.RetryableError(within, sent="maybe") from None
        except (aiohttp.ClientError, OSError) as error:
            said = f"{type(error).__name__}: {error}".strip(": ")
            lost = f"the connection to {host} was lost ({said})"
            raise errors.RetryableError(lost, sent="lost") from None

    async def _read(self, response: aiohttp.ClientResponse) -> tuple[bytes, str]:
        """Return the body, or b"" and its problem."""
        import aiohttp

        if 300 <= response.status < 400:
            return b"", "it redirects, and no redirect is followed"
        pieces: list[bytes] = []
        size = 0
        try:
            async for piece in response.content.iter_any():
                size += len(piece)
                if size > self._most_bytes:
                    return b"", f"the body is larger than {self._most_bytes / 2**20:g} MB"
                pieces.append(piece)
        except aiohttp.ClientPayloadError:
            return b"", "the body breaks off, or is not encoded as it says"
        return b"".join(pieces), ""

    async def aclose(self) -> None:
        """Close all connections."""
        if self._session is not None:
            await self._session.close()
            self._session = None


class OpenAIClient(Client):
    """`POST {api_base}/chat/completions`."""

    def __init__(self, config: ModelConfig, http: HttpClient | None = None) -> None:
        # Otherwise the request, with another provider's key, would go to OpenAI.
        assert config.api_base is not None or config.provider == "openai"
        super().__init__(config, http)
        self._url = f"{(config.api_base or OPENAI_API_BASE).rstrip('/')}/chat/completions"

    async def _complete(self, request: Request, seed: int | None) -> Reply:
        params = wire_params(self.config, request)
        extra_body = params.pop("extra_body", {})
        headers = {
            "Authorization": f"Bearer {api_key(self.config)}",
            "Content-Type": "application/json",
            **params.pop("extra_headers", {}),
        }
        fields = {"model": self.config.provider_model, **params}
        if seed is not None:
            fields["seed"] = seed
        fields |= extra_body
        body = json_body(fields, request, self.config.image_detail)
        answer = await self.http.send(self._url, body, headers)
        return read_completion(read_json(answer), answer.status)


def read_json(answer: Answer) -> object:
    """Return the decoded body of an answer whose status indicates a reply.

    Raises a ModelError if it is incomplete, not JSON within bounds, or an error (with status 200).
    """
    if answer.fault or not answer.is_success:
        raise error_of(answer)
    try:
        body = load_json(answer.body)
    except ValueError as error:
        start = answer.body[:2_000].decode("utf-8", "replace")
        raise malformed(answer.status, f"no JSON ({error}): {start}") from None
    if isinstance(body, Mapping) and body.get("error"):
        raise error_of(answer)
    return body


def read_completion(body: object, status: int = 200) -> Reply:
    """Return the reply in the decoded body of a success.

    Thoughts that a server leaves in the text between think tags become reasoning, as in litellm.
    Raises RetryableError if the body is not a chat completion, or one without choices.
    """
    raw = read_chat_completion(body)
    if raw is None:
        raise malformed(status, f"no choices in it: {str(body)[:2_000]}")
    if not raw.reasoning and (match := _THINKING.match(raw.text)):
        raw = raw.model_copy(update={"reasoning": match[2], "text": match[3]})
    return raw


def malformed(status: int, why: str) -> errors.RetryableError:
    """Return the error of a success without a reply: it was answered, and may be billed."""
    return errors.RetryableError(f"HTTP {status}: malformed reply: {why}", status=status)


def error_of(answer: Answer) -> errors.ModelError:
    """Return the error of an answer without a reply.

    An error that came with a success status is classified by its own code: a reached limit or a
    fault behind a gateway is not a reply that was paid for.
    """
    status = code = answer.status
    if answer.fault and answer.is_success:
        return malformed(status, answer.fault)
    words, codes = (answer.fault, ()) if answer.fault else _words(answer.body)
    text = f"HTTP {status}: {words}"
    if answer.is_success:
        code = next((int(one) for one in codes if _PASSING.fullmatch(one)), status)
        code = next((one for one in _UNAVAILABLE if str(one) in codes), code)
    if code < 500 and _POLICY.search(words):
        return errors.RefusedError(text, status=status)
    if code in _UNAVAILABLE or (code < 500 and _NEVER.search(words)):
        return errors.UnavailableError(text, status=status)
    if answer.is_success or code >= 500 or code in _RETRYABLE:
        return errors.RetryableError(text, status=code, retry_after_s=retry_after_s(answer.headers))
    if 300 <= status < 400:
        text += " (is api_base the address of the API?)"
        return errors.UnavailableError(text, status=status)
    return errors.SampleError(text, status=status)


def _words(body: bytes) -> tuple[str, tuple[str, ...]]:
    """Return the message and codes of an error body; codes are numbers or names."""
    text = body[: 4 * _LONGEST_WORDS].decode("utf-8", "replace")[:_LONGEST_WORDS]
    try:
        raw: Any = load_json(body)
    except ValueError:
        return text, ()
    raw = raw[0] if isinstance(raw, list) and len(raw) == 1 else raw
    error = (raw.get("error") or raw) if isinstance(raw, Mapping) else raw
    if not isinstance(error, Mapping):
        return str(error)[:_LONGEST_WORDS], ()
    said = [error.get(name) for name in ("message", "detail", "code", "status", "type")]
    codes = tuple(str(code) for code in said[2:4] if isinstance(code, str | int))
    return " ".join(str(item) for item in said if item)[:_LONGEST_WORDS] or text, codes


def retry_after_s(headers: Mapping[str, str]) -> float | None:
    """Return the seconds of a `Retry-After` header, which may be an HTTP date; None without one."""
    value = next((v for k, v in headers.items() if k.lower() == "retry-after"), "")
    try:
        date = email.utils.parsedate_tz(value)
        asked_s = email.utils.mktime_tz(date) - time.time() if date else float(value)
    except (ValueError, OverflowError):
        return None
    return max(0.0, asked_s) if math.isfinite(asked_s) else None


def read_raw_reply(raw: object, where: str) -> Reply:
    """Return the reply in a decoded JSON document; `where` names it in errors.

    It has a shape of the official outputs: chat completion, Anthropic message, Gemini response (of
    REST or Python), or a text under `predict`, `text` or `response`. Else raises DataError.
    """
    for read in (read_chat_completion, _anthropic, _gemini):
        if (reply := read(raw)) is not None:
            return reply
    if isinstance(text := _get(raw, "predict", "text", "response"), str):
        return _reply(text)
    found = f"keys {', '.join(map(str, raw))}" if isinstance(raw, Mapping) else type(raw).__name__
    allowed = "a chat completion, an Anthropic message, a Gemini response, predict, text, response"
    message = "is not a recorded reply of a known shape"
    raise errors.DataError(errors.Problem(where, message, "", found, allowed))


def read_chat_completion(raw: object) -> Reply | None:
    """Read OpenAI's shape and its copies: `choices[0].message`, or `choices[0].text`."""
    choice = _get(raw, "choices.0")
    message = choice.get("message", choice) if isinstance(choice, Mapping) else None
    if not isinstance(message, Mapping) or not {"content", "text", "refusal"} & message.keys():
        return None
    text, thoughts = _parts(message.get("content", message.get("text")))
    beside = _text(message.get("reasoning_content") or message.get("reasoning"))
    refusal, details = message.get("refusal"), "usage.prompt_tokens_details"
    cached = f"{details}.cached_tokens", "usage.cached_tokens", "usage.prompt_cache_hit_tokens"
    written = f"{details}.cache_write_tokens", f"{details}.cache_creation_tokens"
    reasoning = _count(raw, "usage.completion_tokens_details.reasoning_tokens")
    usage = Usage(
        # Some servers report 0, which no call takes.
        prompt_tokens=_count(raw, "usage.prompt_tokens") or None,
        completion_tokens=_count(raw, "usage.completion_tokens") or None,
        reasoning_tokens=None if reasoning == 0 and (beside or thoughts) else reasoning,
        cached_tokens=_count(raw, *cached),
        cache_write_tokens=_count(raw, *written),
    )
    return _reply(
        text or _text(refusal),
        "\n".join(filter(None, (beside, thoughts))),
        "refusal" if refusal and not text else _get(choice, "finish_reason"),
        usage,
        _get(raw, "model"),
    )


def _anthropic(raw: object) -> Reply | None:
    """Read Anthropic Messages, whose `input_tokens` exclude cached ones."""
    content = _get(raw, "content")
    if not isinstance(content, list) or not all(isinstance(b, Mapping) for b in content):
        return None
    fresh = _count(raw, "usage.input_tokens")
    cached = _count(raw, "usage.cache_read_input_tokens")
    written = _count(raw, "usage.cache_creation_input_tokens")
    usage = Usage(
        prompt_tokens=None if fresh is None else fresh + (cached or 0) + (written or 0),
        completion_tokens=_count(raw, "usage.output_tokens"),
        cached_tokens=cached,
        cache_write_tokens=written,
    )
    return _reply(*_parts(content), _get(raw, "stop_reason"), usage, _get(raw, "model"))


def _gemini(raw: object) -> Reply | None:
    """Read generateContent; without candidates it is an empty reply if it has a reason or usage."""
    if not isinstance(raw, Mapping) or "candidates" not in raw:
        return None
    candidate = _get(raw, "candidates.0")
    blocked = _get(_get(raw, "promptFeedback", "prompt_feedback"), "blockReason", "block_reason")
    counts = _get(raw, "usageMetadata", "usage_metadata")
    if not isinstance(candidate, Mapping) and not blocked and counts is None:
        return None
    usage = Usage(
        prompt_tokens=_count(counts, "promptTokenCount", "prompt_token_count"),
        completion_tokens=_count(counts, "candidatesTokenCount", "candidates_token_count"),
        reasoning_tokens=_count(counts, "thoughtsTokenCount", "thoughts_token_count"),
        cached_tokens=_count(counts, "cachedContentTokenCount", "cached_content_token_count"),
    )
    finish = "refusal" if blocked else _get(candidate, "finishReason", "finish_reason")
    text, thoughts = _parts(_get(candidate, "content.parts"))
    model = _get(raw, "modelVersion", "model_version")
    return _reply(text, thoughts, finish, usage, model)


def _reply(
    text: str,
    reasoning: str = "",
    finish: object = "",
    usage: Usage | None = None,
    model: object = "",
) -> Reply:
    """Return a reply without lone surrogates, which no file can hold, with its Finish by a word."""
    return Reply(
        text=well_formed(text),
        reasoning=well_formed(reasoning),
        finish=_FINISH.get(str(finish).rpartition(".")[2].lower(), "unknown"),
        usage=usage or Usage(),
        provider_model=well_formed(_text(model)),
    )


def _parts(content: object) -> tuple[str, str]:
    """Return text and thoughts of a content: a string, or a list of parts of any provider."""
    if isinstance(content, str):
        return content, ""
    texts: list[str] = []
    thoughts: list[str] = []
    for part in content if isinstance(content, list) else []:
        if thinking := _text(_get(part, "thinking")):
            thoughts.append(thinking)
        elif _get(part, "thought") is True:
            thoughts.append(_text(_get(part, "text")))
        else:
            texts.append(part if isinstance(part, str) else _text(_get(part, "text")))
    return "".join(texts), "\n".join(text for text in thoughts if text)


def _get(raw: object, *paths: str) -> Any:
    """Return the first value that is not null at a path, or None; `choices.0` is the first item."""
    for path in paths:
        value = raw
        for name in path.split("."):
            if name == "0":
                value = value[0] if isinstance(value, list) and value else None
            else:
                value = value.get(name) if isinstance(value, Mapping) else None
        if value is not None:
            return value
    return None


def _count(raw: object, *paths: str) -> int | None:
    """Return the first plausible number of tokens, or None."""
    found = (_get(raw, path) for path in paths)
    counts = (count for count in found if isinstance(count, int) and not isinstance(count, bool))
    return next((count for count in counts if 0 <= count <= _MOST_TOKENS), None)


def _text(value: object) -> str:
    return value if isinstance(value, str) else ""
