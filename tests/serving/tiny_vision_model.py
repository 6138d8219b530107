"""Make a tiny vision model with random weights: `python tiny_vision_model.py FOLDER [TEXT...]`.

Runs under the interpreter of the serving software, which has torch and transformers and need not
have phyblock. Nothing is downloaded: configuration, weights and tokenizer are made here, the
tokenizer's merges from the given text files. What it says means nothing; that it sees pictures as
tokens, and says the same to the same question, is all it is for.
"""

from __future__ import annotations

import sys
from pathlib import Path

import torch
from tokenizers import Tokenizer, decoders, models, pre_tokenizers, trainers
from transformers import (
    CLIPVisionConfig,
    LlamaConfig,
    LlavaConfig,
    LlavaForConditionalGeneration,
    LlavaProcessor,
    PreTrainedTokenizerFast,
)
from transformers.models.clip.image_processing_pil_clip import CLIPImageProcessorPil

_START, _END, _PADDING, _PICTURE = "<|start|>", "<|end|>", "<|padding|>", "<image>"
_WORDS = 600
_HIDDEN = 128
_PICTURE_PX = 112
_PATCH_PX = 14
_LONGEST = 16_384
_SHORT = 4
"""Tokens of a reply from which on its end becomes likelier with each."""
_CHAT = (
    "{% for message in messages %}<|start|>{{ message['role'] }}\n"
    "{% if message['content'] is string %}{{ message['content'] }}{% else %}"
    "{% for part in message['content'] %}"
    "{% if part['type'] == 'image' %}<image>{% else %}{{ part['text'] }}{% endif %}"
    "{% endfor %}{% endif %}<|end|>\n"
    "{% endfor %}{% if add_generation_prompt %}<|start|>assistant\n{% endif %}"
)


def make_tokenizer(texts: list[str]) -> PreTrainedTokenizerFast:
    """Byte pairs of these texts; whatever else is written is spelled in bytes."""
    tokenizer = Tokenizer(models.BPE())
    tokenizer.pre_tokenizer = pre_tokenizers.ByteLevel(add_prefix_space=False)
    tokenizer.decoder = decoders.ByteLevel()
    trainer = trainers.BpeTrainer(
        vocab_size=_WORDS,
        special_tokens=[_PADDING, _START, _END, _PICTURE],
        initial_alphabet=pre_tokenizers.ByteLevel.alphabet(),
        show_progress=False,
    )
    tokenizer.train_from_iterator(texts, trainer)
    return PreTrainedTokenizerFast(
        tokenizer_object=tokenizer,
        pad_token=_PADDING,
        eos_token=_END,
        chat_template=_CHAT,
        extra_special_tokens={"image_token": _PICTURE},
    )


def make_model(tokenizer: PreTrainedTokenizerFast) -> LlavaForConditionalGeneration:
    """Two layers that see and two that write, and replies that end soon."""
    sizes = {
        "hidden_size": _HIDDEN,
        "intermediate_size": 2 * _HIDDEN,
        "num_hidden_layers": 2,
        "num_attention_heads": 2,
    }
    config = LlavaConfig(
        vision_config=CLIPVisionConfig(**sizes, image_size=_PICTURE_PX, patch_size=_PATCH_PX),
        text_config=LlamaConfig(
            **sizes,
            vocab_size=len(tokenizer),
            max_position_embeddings=_LONGEST,
            pad_token_id=tokenizer.pad_token_id,
            eos_token_id=tokenizer.eos_token_id,
        ),
        image_token_index=tokenizer.convert_tokens_to_ids(_PICTURE),
        vision_feature_layer=-1,
    )
    torch.manual_seed(0)
    model = LlavaForConditionalGeneration(config)
    model.generation_config.do_sample = True
    # What is drawn at random would hardly ever be the end.
    model.generation_config.exponential_decay_length_penalty = (_SHORT, 2.0)
    model.generation_config.eos_token_id = tokenizer.eos_token_id
    model.generation_config.pad_token_id = tokenizer.pad_token_id
    return model


def main(folder: Path, texts: list[str]) -> None:
    """Write model, tokenizer and processor into the folder."""
    tokenizer = make_tokenizer(texts)
    make_model(tokenizer).save_pretrained(folder)
    size = {"height": _PICTURE_PX, "width": _PICTURE_PX}
    pictures = CLIPImageProcessorPil(size={"shortest_edge": _PICTURE_PX}, crop_size=size)
    processor = LlavaProcessor(
        image_processor=pictures,
        tokenizer=tokenizer,
        patch_size=_PATCH_PX,
        vision_feature_select_strategy="default",
        # The vision tower puts one before those of the patches.
        num_additional_image_tokens=1,
        chat_template=_CHAT,
    )
    processor.save_pretrained(folder)


if __name__ == "__main__":
    main(Path(sys.argv[1]), [Path(name).read_text(encoding="utf-8") for name in sys.argv[2:]])
