// From the page's JSON values to typed arrays, and from compressed sound to a seekable WAV.

export function bytesFromBase64(text) {
  const binary = atob(text);
  const bytes = new Uint8Array(binary.length);
  for (let i = 0; i < binary.length; i++) bytes[i] = binary.charCodeAt(i);
  return bytes;
}

/** Float32 positions, frame-major (T * J * 3), metres, of an encoded track. */
export function decodePositions(track) {
  const bytes = bytesFromBase64(track.data);
  const view = new DataView(bytes.buffer);
  const count = track.frames * track.joints * 3;
  const positions = new Float32Array(count);
  for (let i = 0; i < count; i++) {
    positions[i] = track.origin[i % 3] + track.quantum * view.getInt16(2 * i, true);
  }
  return positions;
}

function samplesFromWav(bytes) {
  const view = new DataView(bytes.buffer);
  let at = 12;
  while (at + 8 <= bytes.length) {
    const size = view.getUint32(at + 4, true);
    if (String.fromCharCode(...bytes.subarray(at, at + 4)) === "data") {
      const samples = new Float32Array(size / 2);
      for (let i = 0; i < samples.length; i++) {
        samples[i] = view.getInt16(at + 8 + 2 * i, true) / 32768;
      }
      return samples;
    }
    at += 8 + size + (size % 2);
  }
  throw new Error("no data chunk in the WAV");
}

/** Mono samples at audio.rate, exactly audio.samples long. */
export async function decodeSamples(audio) {
  const bytes = bytesFromBase64(audio.data);
  if (audio.mime === "audio/wav") return samplesFromWav(bytes);
  const context = new OfflineAudioContext(1, 1, audio.rate);
  const decoded = (await context.decodeAudioData(bytes.buffer)).getChannelData(0);
  // A decoder that ignores the gapless header leaves LAME's delay (576 + 529 samples) in front.
  const surplus = decoded.length - audio.samples;
  const start = surplus > 1105 ? 1105 : 0;
  const samples = new Float32Array(audio.samples);
  samples.set(decoded.subarray(start, start + audio.samples));
  return samples;
}

/**
 * A WAV of `seconds` length, padded with silence, as a Blob.
 * The audio element seeks in a WAV to the sample, which it does not in an MP3.
 */
export function wavBlob(samples, rate, seconds) {
  const count = Math.max(samples.length, Math.ceil(seconds * rate));
  const view = new DataView(new ArrayBuffer(44 + 2 * count));
  const ascii = (at, text) => [...text].forEach((c, i) => view.setUint8(at + i, c.charCodeAt(0)));
  ascii(0, "RIFF");
  view.setUint32(4, 36 + 2 * count, true);
  ascii(8, "WAVEfmt ");
  view.setUint32(16, 16, true);
  view.setUint16(20, 1, true);
  view.setUint16(22, 1, true);
  view.setUint32(24, rate, true);
  view.setUint32(28, 2 * rate, true);
  view.setUint16(32, 2, true);
  view.setUint16(34, 16, true);
  ascii(36, "data");
  view.setUint32(40, 2 * count, true);
  for (let i = 0; i < samples.length; i++) {
    const clipped = Math.max(-1, Math.min(1, samples[i]));
    view.setInt16(44 + 2 * i, Math.round(clipped * 32767), true);
  }
  return new Blob([view.buffer], { type: "audio/wav" });
}
