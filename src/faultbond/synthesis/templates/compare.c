/* compare EXPECTED FOUND TOLERANCE: tells whether two files of records say the same. Texts and whole numbers must be equal, other
   numbers so within a tolerance, relative. Candidates that both call hopeless may differ: what fits nothing has estimates that
   hang on the last digits of all numbers. The first difference is told, and then the exit code is 1. */
#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LONGEST 1048576 /* bytes of a line */
#define NOTHING 1e-14   /* by which any two numbers may differ */
#define HOPELESS 1e-9   /* probability of a candidate below which nothing is asked of it */

static char expected[LONGEST], found[LONGEST];

/* Whether a number begins here, which no text does: texts are skipped by `same`. */
static int begins_number(const char *text) { return isdigit((unsigned char)*text) || (*text == '-' && isdigit((unsigned char)text[1])); }

static int is_whole(const char *first, const char *end)
{
    for (; first < end; first++)
        if (*first == '.' || *first == 'e') return 0;
    return 1;
}

/* Take a number off both; 0 where they differ. */
static int same_number(const char **one, const char **two, double tolerance)
{
    char *end_one, *end_two;
    const double a = strtod(*one, &end_one), b = strtod(*two, &end_two);
    const int whole = is_whole(*one, end_one) && is_whole(*two, end_two);
    const int same = whole ? a == b : fabs(a - b) <= tolerance * (fabs(a) > fabs(b) ? fabs(a) : fabs(b)) + NOTHING;
    if (!same) return 0;
    *one = end_one;
    *two = end_two;
    return 1;
}

/* Where the object that begins here ends. */
static const char *behind_object(const char *text)
{
    int depth = 0, in_text = 0;
    for (; *text; text++) {
        if (in_text && *text == '\\' && text[1]) text++;
        else if (*text == '"') in_text = !in_text;
        else if (!in_text && *text == '{') depth++;
        else if (!in_text && *text == '}' && --depth == 0) return text + 1;
    }
    return text;
}

/* Whether a candidate begins here that is hopeless. */
static int is_hopeless(const char *text)
{
    static const char BEGIN[] = "{\"components\": ", CHANCE[] = "\"probability\": ";
    if (strncmp(text, BEGIN, sizeof BEGIN - 1) != 0) return 0;
    const char *const chance = strstr(text, CHANCE);
    return chance && chance < behind_object(text) && strtod(chance + sizeof CHANCE - 1, NULL) < HOPELESS;
}

/* Whether two lines say the same; where not, `one` and `two` stand at the difference. */
static int same(const char **one, const char **two, double tolerance)
{
    int in_text = 0;
    while (**one && **two) {
        if (!in_text && begins_number(*one) && begins_number(*two)) {
            if (!same_number(one, two, tolerance)) return 0;
            continue;
        }
        if (!in_text && is_hopeless(*one) && is_hopeless(*two)) {
            *one = behind_object(*one);
            *two = behind_object(*two);
            continue;
        }
        if (**one != **two) return 0;
        if (in_text && **one == '\\' && (*one)[1] && (*one)[1] == (*two)[1]) {
            ++*one;
            ++*two;
        } else if (**one == '"') {
            in_text = !in_text;
        }
        ++*one;
        ++*two;
    }
    return **one == **two;
}

int main(int n, char **arguments)
{
    FILE *one = n == 4 ? fopen(arguments[1], "rb") : NULL, *two = one ? fopen(arguments[2], "rb") : NULL;
    if (!two) {
        fprintf(stderr, "compare EXPECTED FOUND TOLERANCE: a file cannot be read\n");
        return 2;
    }
    const double tolerance = atof(arguments[3]);
    for (long line = 1;; line++) {
        const int more = fgets(expected, LONGEST, one) != NULL, also = fgets(found, LONGEST, two) != NULL;
        if (!more && !also) {
            printf("%ld records, as expected\n", line - 1);
            return 0;
        }
        const char *a = more ? expected : "", *b = also ? found : "";
        if (!more || !also || !same(&a, &b, tolerance)) {
            printf("record %ld: expected ...%.60s\n", line, a);
            printf("record %ld: found    ...%.60s\n", line, b);
            return 1;
        }
    }
}
