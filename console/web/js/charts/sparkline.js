// The last minute or so of one number in 0..1, on a small canvas.

const kWidth = 96;
const kHeight = 22;
const kCapacity = 60;
const kWordHeight = 9;  // Above the line.

export function drawSparkline(canvas, values, color) {
  const ratio = Math.min(2, devicePixelRatio || 1);
  if (canvas.width !== kWidth * ratio) {
    canvas.width = kWidth * ratio;
    canvas.height = kHeight * ratio;
  }
  const context = canvas.getContext('2d');
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, kWidth, kHeight);
  context.strokeStyle = color;
  context.lineWidth = 1.25;
  context.beginPath();
  const step = kWidth / (kCapacity - 1);
  let x = kWidth - step * (values.length - 1);
  let down = false;
  for (const value of values) {
    if (value === null) {
      down = false;
    } else {
      const y = kHeight - 1.5 - (kHeight - kWordHeight - 3) *
        Math.min(1, Math.max(0, value));
      if (down) context.lineTo(x, y);
      else context.moveTo(x, y);
      down = true;
    }
    x += step;
  }
  context.stroke();
  context.font = '9px system-ui, sans-serif';
  context.fillStyle = color;
  context.fillText('deviation', 0, 8);
}
