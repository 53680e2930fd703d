// The sound is the clock: every other part asks this one what time it is.
import { decodeSamples, wavBlob } from "./decode.js";

const SILENCE_RATE = 16000;

export class Clock {
  constructor(changed) {
    this.audio = document.createElement("audio");
    this.audio.preload = "auto";
    this.duration = 0;
    for (const name of ["play", "pause", "seeked", "ended", "ratechange"]) {
      this.audio.addEventListener(name, changed);
    }
  }

  /** Take a clip's sound; resolves with its samples (empty for a silent clip) once it can seek. */
  async load(clip) {
    this.audio.pause();
    const rate = clip.audio ? clip.audio.rate : SILENCE_RATE;
    const samples = clip.audio ? await decodeSamples(clip.audio) : new Float32Array(0);
    const old = this.audio.src;
    const rateBefore = this.audio.playbackRate;
    this.duration = clip.duration;
    this.audio.src = URL.createObjectURL(wavBlob(samples, rate, clip.duration));
    if (old) URL.revokeObjectURL(old);
    await new Promise((resolve, reject) => {
      this.audio.addEventListener("canplaythrough", resolve, { once: true });
      this.audio.addEventListener("error", () => reject(this.audio.error), { once: true });
    });
    this.audio.playbackRate = rateBefore;
    return samples;
  }

  get time() {
    return Math.min(this.audio.currentTime, this.duration);
  }

  get playing() {
    return !this.audio.paused && !this.audio.ended;
  }

  seek(t) {
    this.audio.currentTime = Math.max(0, Math.min(this.duration, t));
  }

  play() {
    if (this.audio.ended || this.time >= this.duration - 1e-3) this.audio.currentTime = 0;
    return this.audio.play();
  }

  pause() {
    this.audio.pause();
  }
}
