"""Gesture generation from the trimodal context of text, audio and speaker (Yoon et al. 2020)."""

from __future__ import annotations

import logging
from typing import Any, ClassVar, Literal, cast, get_args

import torch
from lightning.pytorch.core.optimizer import LightningOptimizer
from torch import Tensor, nn

from cospeech.adversarial.adversary import Adversary
from cospeech.adversarial.losses import ON_PROBABILITIES, chosen_losses
from cospeech.corpus.batch import GestureBatch
from cospeech.corpus.facts import CorpusFacts
from cospeech.corpus.windows import WindowSpec
from cospeech.errors import ConfigError, CospeechError, require_choice, require_range
from cospeech.methods.base import GestureMethod
from cospeech.methods.streams import Stream
from cospeech.methods.trimodal.chunks import seed_input, spread_words
from cospeech.methods.trimodal.losses import diversity_loss, reconstruction_loss, style_divergence
from cospeech.methods.trimodal.networks import (
    POSE_SIZE,
    Context,
    ConvDiscriminator,
    Generator,
    Style,
)
from cospeech.methods.trimodal.style import known_controls, read_style_request
from cospeech.methods.trimodal.synthesis import (
    Chunks,
    Styles,
    Synthesiser,
    SynthesisOptions,
    draw_noise,
    draw_speakers,
)
from cospeech.methods.trimodal.words import WordVectorFile, check_dimensions
from cospeech.motion.codecs import DirectionVectorCodec
from cospeech.motion.motion import Motion
from cospeech.nn.modes import evaluating
from cospeech.speech.vocabulary import Vocabulary
from cospeech.speech.word_vectors import load_word_vectors
from cospeech.training.losses import WeighedLosses
from cospeech.training.steps import descend, log_losses

logger = logging.getLogger(__name__)

WordEmbedding = Literal["fine_tune", "frozen", "scratch"]
WordTiming = Literal["onset", "even"]

MOST_LAYERS = 100


class Trimodal(GestureMethod):
    """GAN of Yoon et al. 2020: text, audio and a style embedding of speakers to upper-body motion.

    Defaults are the published code's, quirks included (the README lists them), but for the words of
    a transcript: each argument that defaults to False turns one quirk off, and ``fold_case`` and
    ``subwords``, which change nothing in training, bring one back when False.

    Reads positions, audio, words and speakers. Logs, unweighted, ``train/huber``,
    ``train/diversity``, ``train/kld``, ``train/adversarial``, ``train/discriminator`` and the
    weighted sum ``train/loss``.

    Args:
        corpus: Vocabulary, speakers and statistics of the training corpus.
        context: Modalities that reach the generator.
        word_timing: ``"onset"`` puts a word on the frame where it begins; ``"even"`` drops the
            timing and spreads a window's words evenly, as the published text-only code does.
        style: ``"speaker"`` learns a style space, ``"random"`` draws styles from N(0, I),
            ``"none"`` has no style input.
        style_size: Numbers per style vector (16 in the code, 8 in the paper).
        hidden_size: Width of the generator's GRU and text convolutions.
        layers: GRU layers and text blocks.
        dropout: Between GRU layers, inside text blocks and in the discriminator's GRU.
        embedding_dropout: On word vectors.
        word_embedding: ``"fine_tune"`` or ``"frozen"`` pre-trained vectors, or ``"scratch"``.
        word_vectors: fastText file (.bin or .vec) to start from, read when training starts; None
            starts from N(0, 1/300). The vectors are then in the checkpoint; ``generate`` looks into
            the file for further words where it still exists, else it goes without.
            ``load_from_checkpoint(path, word_vectors=...)`` names it anew.
        huber_weight: Weight of the reconstruction loss.
        adversarial_weight: Weight of the adversarial loss.
        adversarial_loss: Its name among `cospeech.adversarial.losses.ON_PROBABILITIES`.
        diversity_weight: Weight of the diversity loss; 0 switches the KLD off too, as published.
        kld_weight: Weight of the KL divergence of the style space.
        adversarial_start_epoch: First epoch, counted from 0, with the adversary (the code compares
            ``epoch > 10``: 11 warm-up epochs where the paper says 10).
        learning_rate: Adam's rate for encoders and generator.
        discriminator_learning_rate: Adam's rate for the discriminator.
        betas: Adam's betas.
        corrected_activations: Real leaky ReLU where the published code has the identity.
        mean_style: Use the mean style outside training instead of a sample.
        fixed_style: One style sample per utterance instead of one per chunk.
        unit_length: Normalise generated direction vectors, so that bones keep their length.
        trained_speakers_only: Never draw the untrained row 0 when no speaker is asked for.
        fold_case: Normalise transcripts as the corpus was before looking words up; False misses
            "Hello" where "hello" is known, as published.
        subwords: Words outside the vocabulary take their vectors from the file of ``word_vectors``,
            composed of sub-words if it's a .bin file; False makes all of them the unknown word, as
            published.

    Raises:
        ConfigError: A value that is not among the choices or out of range, or a word vector file
            with ``word_embedding="scratch"``.
    """

    window = WindowSpec(fps=15.0, frames=34, seed_frames=4, stride=10)
    needs: ClassVar[frozenset[str]] = frozenset({"positions", "audio", "words", "speakers"})

    def __init__(
        self,
        corpus: CorpusFacts,
        context: Context = "both",
        word_timing: WordTiming = "onset",
        style: Style = "speaker",
        style_size: int = 16,
        hidden_size: int = 300,
        layers: int = 4,
        dropout: float = 0.3,
        embedding_dropout: float = 0.1,
        word_embedding: WordEmbedding = "fine_tune",
        word_vectors: str | None = None,
        huber_weight: float = 500.0,
        adversarial_weight: float = 5.0,
        adversarial_loss: str = "non_saturating",
        diversity_weight: float = 0.05,
        kld_weight: float = 0.1,
        adversarial_start_epoch: int = 11,
        learning_rate: float = 5e-4,
        discriminator_learning_rate: float = 1e-4,
        betas: tuple[float, float] = (0.5, 0.999),
        corrected_activations: bool = False,
        mean_style: bool = False,
        fixed_style: bool = False,
        unit_length: bool = False,
        trained_speakers_only: bool = False,
        fold_case: bool = True,
        subwords: bool = True,
    ) -> None:
        super().__init__()
        require_choice("model.context", context, get_args(Context))
        require_choice("model.word_timing", word_timing, get_args(WordTiming))
        require_choice("model.style", style, get_args(Style))
        require_choice("model.word_embedding", word_embedding, get_args(WordEmbedding))
        require_range("model.layers", layers, 1, MOST_LAYERS)
        if word_embedding == "scratch" and word_vectors is not None:
            raise ConfigError(
                "word_embedding=scratch starts from no vectors, but word_vectors names a file",
                "drop word_vectors, or choose fine_tune or frozen",
            )
        self.save_hyperparameters(logger=False)
        self.context, self.style = context, style
        self.word_embedding, self.word_vectors = word_embedding, word_vectors
        self.huber_weight = huber_weight
        self.diversity_weight = diversity_weight
        self.kld_weight = kld_weight
        self.learning_rate = learning_rate
        self.discriminator_learning_rate = discriminator_learning_rate
        self.betas = betas
        self.word_timing = word_timing
        self.options = SynthesisOptions(
            word_timing=word_timing,
            mean_style=mean_style,
            fixed_style=fixed_style,
            unit_length=unit_length,
            trained_speakers_only=trained_speakers_only,
            fold_case=fold_case,
        )
        self.vocabulary = Vocabulary(corpus["words"])
        self.speakers = list(corpus["speakers"])
        self.codec = DirectionVectorCodec(
            list(corpus["mean_direction"]), list(corpus["bone_lengths"])
        )
        self.generator = Generator(
            len(self.vocabulary),
            len(self.speakers),
            style_size=style_size,
            hidden_size=hidden_size,
            layers=layers,
            dropout=dropout,
            embedding_dropout=embedding_dropout,
            context=context,
            style=style,
            corrected_activations=corrected_activations,
        )
        embedding = self.generator.text_encoder.embedding
        if word_embedding != "scratch":
            nn.init.normal_(embedding.weight, 0, embedding.embedding_dim**-0.5)
        embedding.weight.requires_grad_(word_embedding != "frozen")
        self._vector_file: WordVectorFile | None = None
        if word_vectors is not None and subwords and context != "audio":
            self._vector_file = WordVectorFile(word_vectors, embedding.embedding_dim)
        self.adversary = Adversary(
            ConvDiscriminator(
                self.window.frames, dropout=dropout, corrected_activations=corrected_activations
            ),
            chosen_losses(adversarial_loss, ON_PROBABILITIES, "model.adversarial_loss"),
            weight=adversarial_weight,
            start_epoch=adversarial_start_epoch,
        )

    def setup(self, stage: str) -> None:
        """Read the word vectors before a new training; a resumed one has them in its checkpoint."""
        if stage != "fit" or self.trainer.ckpt_path is not None:
            return
        if self.word_vectors is None and self.word_embedding == "frozen":
            logger.warning("frozen word embedding without word_vectors: random vectors stay random")
        if self.word_vectors is not None:
            weight = self.generator.text_encoder.embedding.weight
            vectors = load_word_vectors(self.word_vectors, self.vocabulary.words, seed=0)
            check_dimensions(self.word_vectors, vectors.shape[1], weight.shape[1])
            weight.data.copy_(torch.from_numpy(vectors))

    def configure_optimizers(self) -> list[torch.optim.Optimizer]:
        """Adam for the generator with its encoders, Adam for the discriminator."""
        return [
            torch.optim.Adam(self.generator.parameters(), self.learning_rate, self.betas),
            torch.optim.Adam(
                self.adversary.parameters(), self.discriminator_learning_rate, self.betas
            ),
        ]

    def training_step(self, batch: GestureBatch, batch_idx: int) -> dict[str, Tensor]:
        """One discriminator and one generator update from one shared generator pass.

        See docs/facts/trimodal.md, section 2.2.
        """
        generator_optimizer, discriminator_optimizer = cast(
            list[LightningOptimizer], self.optimizers()
        )
        target = self.codec.encode(batch.require("positions"))
        seed_poses = seed_input(target[:, : self.window.seed_frames], self.window.frames)
        speakers = batch.require("speakers")
        playing = self.adversary.is_active(self.current_epoch)
        self.generator.audio_encoder.count_passes(
            1 + playing + (self.style != "none" and self.diversity_weight > 0)
        )
        speech = self._encode_speech(batch)
        z, posterior = self.generator.draw_style(speakers, self._style_noise(len(batch)))
        poses = self.generator.decode(seed_poses, speech, z)
        losses, logs = WeighedLosses(), dict[str, Tensor]()

        if playing:
            own_loss = self.adversary.own_loss(target, poses)
            descend(self, discriminator_optimizer, own_loss)
            logs["discriminator"] = own_loss

        losses.add("huber", self.huber_weight, reconstruction_loss, poses, target)
        # Evaluated in every epoch, as published: it moves the discriminator's running statistics.
        weight = self.adversary.weight if playing else 0
        losses.add("adversarial", weight, self.adversary.generator_loss, poses)
        if z is not None:
            shown = (poses, seed_poses, speech, z, speakers)
            losses.add("diversity", self.diversity_weight, self._diversity, *shown)
        if posterior is not None:
            weight = self.kld_weight if self.diversity_weight > 0 else 0
            losses.add("kld", weight, style_divergence, posterior.mu, posterior.logvar)
        if losses.total is not None:
            descend(self, generator_optimizer, losses.total)
            logs["loss"] = losses.total
        return log_losses(self, logs | losses.values, len(batch))

    def _diversity(
        self, poses: Tensor, seed_poses: Tensor, speech: Tensor, z: Tensor, speakers: Tensor
    ) -> Tensor:
        """Diversity loss against other styles: another item's speaker, and a new draw.

        No gradient passes through the second decoding, so it builds no graph.
        """
        with torch.no_grad():
            others = speakers[self._permutation(len(speakers))]
            other_z, _ = self.generator.draw_style(others, self._style_noise(len(speakers)))
            assert other_z is not None
            other_poses = self.generator.decode(seed_poses, speech, other_z)
        return diversity_loss(poses, other_poses, z, other_z)

    def _style_noise(self, count: int) -> Tensor:
        return torch.randn(count, self.generator.style_size, device=self.device)

    def _permutation(self, count: int) -> Tensor:
        return torch.randperm(count, device=self.device)

    def _encode_speech(self, batch: GestureBatch) -> Tensor:
        words = batch.require("words")
        if self.word_timing == "even":
            words = spread_words(words)
        return self.generator.encode_speech(words, batch.require("audio"))

    @torch.no_grad()
    def sample(self, batch: GestureBatch, generator: torch.Generator) -> Tensor:
        """One window per item from its real seed poses (docs/facts/trimodal.md, section 4.1).

        A known speaker keeps their own style; an unknown one (id 0) gets a random training
        speaker's, as every item does in the published evaluation. Seed frames are generated too.
        """
        seeds = self.codec.encode(batch.require("positions")[:, : self.window.seed_frames])
        speakers = batch.require("speakers")
        drawn = draw_speakers(len(batch), min(1, len(self.speakers)), len(self.speakers), generator)
        speakers = torch.where(speakers > 0, speakers, drawn.to(speakers.device))
        noise = None
        if not self.options.mean_style:
            noise = draw_noise(len(batch), self.generator.style_size, generator).to(self.device)
        with evaluating(self.generator):
            z, _ = self.generator.draw_style(speakers, noise)
            poses = self.generator.decode(
                seed_input(seeds, self.window.frames), self._encode_speech(batch), z
            )
        return self.codec.decode(poses, unit_length=self.options.unit_length)

    def begin(
        self,
        speaker: str | None,
        controls: dict[str, Any] | None,
        seed_motion: Motion | None,
        generator: torch.Generator,
    ) -> Stream:
        """Begin root-relative motion at 15 fps, chunk by chunk (section 3.3).

        See docs/facts/trimodal.md, section 5.

        Chunks of 34 frames start every 30; each takes the last four frames of the one before as
        seeds, and the overlap is blended. Without a transcript the words are padding. Words outside
        the vocabulary are logged; see ``subwords`` for what becomes of them. Without a seed motion
        the first chunk has no seeds, as published.

        Raises:
            CospeechError: More than one wish for a style, or one that this model has no input for;
                of `push`, a word vector file that is there but can't be read.
        """
        voice = Synthesiser(
            self.generator,
            self.codec,
            self.window,
            self.vocabulary,
            self._vector_file,
            self.speakers,
            self.options,
        )
        request = read_style_request(speaker, controls or {}, self.speakers, self.generator)
        seeds = torch.zeros(0, POSE_SIZE, device=self.device)
        if seed_motion is not None:
            last = seed_motion.positions[-self.window.seed_frames :]
            seeds = self.codec.encode(torch.tensor(last, dtype=torch.float32, device=self.device))
        return Chunks(voice, Styles(request, voice, generator), seeds)

    def parse_controls(self, values: Any) -> dict[str, Any]:
        """A point in the style space or a mix of speakers.

        Args:
            values: ``{"style": [16 numbers]}``, or ``{"speaker_mix": {"a": 0.3, "b": 0.7}}``, an
                interpolation between speakers; one of them, and no speaker beside it.

        Raises:
            CospeechError: Not a mapping, or an unknown control.
        """
        return known_controls(values)

    @torch.no_grad()
    def style_vectors(self) -> Tensor:
        """Mean style of each training speaker, ``(speakers, style_size)``, in corpus order.

        Raises:
            CospeechError: The model was trained without speakers.
        """
        if self.style != "speaker":
            raise CospeechError(f"this model knows no speakers (style={self.style})")
        ids = torch.arange(1, len(self.speakers) + 1, device=self.device)
        return self.generator.style_posterior(ids).mu
