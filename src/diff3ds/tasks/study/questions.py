"""What a study asks of each sketch: the paper's two criteria, in this project's words."""

QUESTIONS = {
    "quality": "How good is this sketch, as a drawing of one solid thing from four sides?",
    "match": "How well does it show what was asked for?",
}
LEAST, MOST = 1, 5
